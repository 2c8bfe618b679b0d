"""The half-normal law in coordinates that one step suits everywhere.

NumPyro takes the logarithm of what is above zero. There a half-normal falls off like exp(-exp(2 z) / 2) on the right:
of a scale that the data say little about, NUTS learns long steps from the long tail on the left, and with these it
diverges at the wall. Here z is the inverse softplus of the value over its scale: the logarithm on the left, as before,
and on the right the value itself, of which a half-normal is normal.
"""

from typing import Any, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike
from numpyro import distributions as dist  # not `import numpyro.distributions`: ArviZ leaves a lazy numpyro behind
from numpyro.distributions import constraints, transforms

Scale = np.ndarray | Array | float


class _PositiveInScales(constraints.Constraint):
    """Numbers above 0 whose size goes by a scale, which must be a constant: it stays when a trace is over."""

    def __init__(self, scale: Scale) -> None:
        self.scale = scale

    def __call__(self, x: ArrayLike) -> Array:
        return jnp.asarray(x) > 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _PositiveInScales) and bool(np.array_equal(self.scale, other.scale))

    def feasible_like(self, prototype: ArrayLike) -> Array:
        return jnp.broadcast_to(self.scale, jnp.shape(prototype))

    def tree_flatten(self) -> tuple[tuple[Scale], tuple[tuple[str], dict[str, Any]]]:
        return (self.scale,), (("scale",), {})


@transforms.biject_to.register(_PositiveInScales)
def _softplus_in_scales(constraint: _PositiveInScales) -> transforms.ComposeTransform:
    times = transforms.AffineTransform(0.0, constraint.scale, domain=constraints.positive)
    return transforms.ComposeTransform([transforms.SoftplusTransform(), times])


class HalfNormal(dist.HalfNormal):
    """NumPyro's half-normal, sampled as the inverse softplus of its value over its scale."""

    @property
    def support(self) -> constraints.Constraint:
        """Above 0, in units of the scale."""
        return _PositiveInScales(cast(Scale, self.scale))
