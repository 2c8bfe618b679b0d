"""The least-squares problem of a record: points, fixed values, starts, bounds; and the same in scaled units."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from bayes_tyre.inference.least_squares.parameters import BETA, D_I, F_I, C, K
from bayes_tyre.laws.fancher import equation_2

#: Limits of beta over the travel, beyond which beta changes no force: the search ends there.
BETA_ENDS = (1e-12, 1e3)


class Problem(NamedTuple):
    """One record with fixed values, starts and bounds of its parameters; a leading axis batches it.

    Attributes
    ----------
    d, F:
        Displacement (mm) and force (kN), shape (points,).
    used:
        Shape (points,); False on padding. The first point is always used.
    fixed:
        Shape (5,), in the order of `PARAMETERS`; NaN where not given (d_i, F_i: the first point). Used
        where the parameter is not free.
    start:
        Shape (starts, 5); NaN where not given: estimated from the data. The best of the fits counts.
    low, high:
        Shape (5,); bounds of the free parameters, infinite where there is none. None: nothing is bounded.
    """

    d: Float[Array, "*records points"]
    F: Float[Array, "*records points"]
    used: Bool[Array, "*records points"]
    fixed: Float[Array, "*records 5"]
    start: Float[Array, "*records starts 5"]
    low: Float[Array, "*records 5"] | None = None
    high: Float[Array, "*records 5"] | None = None

    @property
    def base(self) -> Float[Array, "5"]:
        """Values of the parameters that are not free: as given, else the first point for d_i and F_i."""
        first = jnp.stack([jnp.zeros(()), jnp.zeros(()), jnp.ones(()), self.d[0], self.F[0]])
        return jnp.where(jnp.isnan(self.fixed), first, self.fixed)

    @property
    def bounds(self) -> tuple[Float[Array, "5"], Float[Array, "5"]]:
        """Low and high bounds, infinite where there is none."""
        none = jnp.full(5, jnp.inf)
        return (-none if self.low is None else self.low), (none if self.high is None else self.high)


class OwnUnits(NamedTuple):
    """The map of a record's displacements, forces and parameters to scaled units, and back.

    Equation 2 keeps its form in scaled units. So the solver sees the same values whatever the units and origins of
    displacement and force are.

    Attributes
    ----------
    origin:
        Displacement that is zero in scaled units, mm: the first point, or 0 where C is fixed or bounded. C is the
        line's force at zero displacement; far from there it is nearly collinear with k.
    travel, span:
        Largest distance from the first point (mm) and from its force (kN); 1 where there is none.
    force:
        Force that is zero in scaled units, kN: the first point's.
    """

    origin: Float[Array, ""]
    travel: Float[Array, ""]
    span: Float[Array, ""]
    force: Float[Array, ""]

    @property
    def unit(self) -> Float[Array, "5"]:
        """One scaled unit of each parameter, in the order and units of `PARAMETERS`."""
        return jnp.stack([self.span / self.travel, self.span, self.travel, self.travel, self.span])

    @property
    def zero(self) -> Float[Array, "5"]:
        """Value of each parameter that is zero in scaled units; of C where k is 0."""
        nothing = jnp.zeros(())
        return jnp.stack([nothing, self.force, nothing, self.origin, self.force])

    def scaled(self, value: Float[Array, "5"]) -> Float[Array, "5"]:
        """Return parameters in scaled units; C becomes the line's force at `origin`."""
        return (value.at[C].add(value[K] * self.origin) - self.zero) / self.unit

    def given(self, scaled: Float[Array, "5"]) -> Float[Array, "5"]:
        """Return parameters in the units that they were given in, kN and mm."""
        value = scaled * self.unit + self.zero
        return value.at[C].add(-value[K] * self.origin)

    def deviations(self, root: Float[Array, "5 n"]) -> Float[Array, "5"]:
        """Return standard deviations, kN and mm, from a square root of the parameters' covariance in scaled units."""
        rows = root.at[C].add(-root[K] * self.origin / self.travel)
        return self.unit * jnp.linalg.norm(rows, axis=1)


class ScaledProblem(NamedTuple):
    """A record with its fixed parameters and bounds, in scaled units.

    Attributes
    ----------
    units:
        The scaled units.
    d, F, used:
        Shape (points,): displacement, force, False on padding.
    base, low, high:
        Shape (5,): values of the parameters that are not free; bounds, infinite where there is none.
    """

    units: OwnUnits
    d: Float[Array, " points"]
    F: Float[Array, " points"]
    used: Bool[Array, " points"]
    base: Float[Array, "5"]
    low: Float[Array, "5"]
    high: Float[Array, "5"]

    @property
    def beta_ends(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Least and largest beta: its bounds, or limits beyond which beta changes no force."""
        low, high = self.low[BETA], self.high[BETA]
        least = jnp.where(low > 0, low, jnp.minimum(BETA_ENDS[0], 1e-3 * high))
        return least, jnp.where(jnp.isfinite(high), high, jnp.maximum(BETA_ENDS[1], 1e3 * least))

    def residual(self, value: Float[Array, "5"]) -> Float[Array, " points"]:
        """Return force by Equation 2 less the measured one, 0 on padding."""
        force = equation_2(self.d, k=value[K], C=value[C], beta=value[BETA], d_i=value[D_I], F_i=value[F_I])
        return jnp.where(self.used, force - self.F, 0.0)


def scale_problem(problem: Problem, free: tuple[int, ...]) -> ScaledProblem:
    """Return a problem, without a leading axis, in scaled units; `free`: indices of the parameters to fit."""
    d, F, used = problem.d, problem.F, problem.used
    low, high = problem.bounds
    travel = jnp.max(jnp.where(used, jnp.abs(d - d[0]), 0.0))
    span = jnp.max(jnp.where(used, jnp.abs(F - F[0]), 0.0))
    keep_zero = jnp.isfinite(low[C]) | jnp.isfinite(high[C]) | (C not in free)
    origin = jnp.where(keep_zero, 0.0, d[0])
    units = OwnUnits(origin, jnp.where(travel > 0, travel, 1.0), jnp.where(span > 0, span, 1.0), F[0])
    return ScaledProblem(
        units,
        (d - origin) / units.travel,
        (F - units.force) / units.span,
        used,
        units.scaled(problem.base),
        (low - units.zero) / units.unit,
        (high - units.zero) / units.unit,
    )
