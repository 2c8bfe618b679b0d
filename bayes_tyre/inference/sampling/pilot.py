"""The beginning of a collapsed run: where the posterior is, so that the summaries of the records can be about it.

First the normal approximation of what the records share, at its mode; then short runs of the chains that begin there.
Each time the summaries are made anew about draws. The draws of all chains together also say what the mass matrix is:
the windows of the warmup in which each chain would learn it by itself are skipped.

The error of a record's summary is small but alike in many records: its slope along the shared unknowns grows with their
number, while the posterior narrows with the root of it. With thousands of records that slope is measured and added to
the log density, except the part due to choices of discordant repeats, which are drawn and have no derivative.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float
from numpyro.infer.hmc import HMCState

from bayes_tyre.inference.model.collapsed.model import SUMMARY_ERROR
from bayes_tyre.inference.model.collapsed.nearest_summaries import refine_summaries
from bayes_tyre.inference.model.collapsed.record_summaries import RecordSummaries
from bayes_tyre.inference.sampling.chunks import CHUNK
from bayes_tyre.inference.sampling.nuts import Chains
from bayes_tyre.inference.sampling.posterior_mode import normal_approximation
from bayes_tyre.inference.sampling.run import Begun, Draws, SamplerSettings
from bayes_tyre.inference.sampling.summary_error import SUMMARY_ERROR_MOST, SummaryError, flat, summary_error

#: Most rounds in which summaries are made anew about the mode; least and most about chunks of the chains. With many
#: records a chunk has too few draws to show that an error is small.
_ROUNDS_AT_MODE, _ROUNDS_OF_CHAINS = 4, (2, 4)
#: With many records: most rounds at the mode, and draws for each chain in such a round, enough to locate each record.
_ROUNDS_AT_MODE_OF_MANY, _DRAWS_AT_MODE_OF_MANY = 2, 20
#: Largest error of the summaries that chance may hide. Where chance may hide more, slopes measure the error from
#: `_MANY_RECORDS` records on; with fewer records such summaries are not used.
_BY_CHANCE_MOST, _MANY_RECORDS = 0.2, 1000
#: Draws of each chain at which slopes of what the summaries miss are taken, at most a chunk.
_DRAWS_OF_SLOPES = 100
#: What slopes are taken for, to tell their seeds apart; others are numbers of attempts, which are few.
_OF_PILOT, _OF_ERROR = 100, 101
#: Chunks before the first round of chains that begin far from the posterior.
_APPROACH_CHUNKS = 2
#: Iterations of the warmup that the pilot run stands for: those of the default but for a chunk.
_WARMUP_BY_PILOT = 500
#: Draws that the covariance so far counts as, at least, beside a chunk's of each chain; and as many as there
#: are unknowns, for the covariance of fewer draws than these is worse than the mode's.
_COVARIANCE_DRAWS = 100
#: Squared standard errors of a slope that are taken off its square: what chance explains, twice over.
_BEYOND_CHANCE = 4.0
_TINY = float(np.finfo(float).tiny)
_NO_SITES: Mapping[str, np.ndarray] = MappingProxyType({})
#: Sites whose draws summaries are made about.
_OF_SUMMARIES = ("k", "beta", "sigma", "rho", "J_group", "sd_J")


class Location(NamedTuple):
    """Where the posterior is, as far as it is known.

    Attributes
    ----------
    summaries, error:
        Summaries of the records; and the error of the previous summaries, at the draws that these were made about.
    draws, covariance:
        Draws of the unknowns of what the records share, unconstrained, and their covariance; None: not known.
    sites:
        What summaries are made of (`_OF_SUMMARIES`) at the draws of the last chunk of the chains; empty before there
        was one.
    slope:
        Of what the summaries miss of the log density, along the unknowns; None: not measured, and left out.
    """

    summaries: RecordSummaries
    error: SummaryError
    draws: Float[np.ndarray, "chains draws unknowns"] | None = None
    covariance: Float[np.ndarray, "unknowns unknowns"] | None = None
    sites: Mapping[str, np.ndarray] = _NO_SITES
    slope: Float[np.ndarray, " unknowns"] | None = None


class Pilot(NamedTuple):
    """What a pilot run moves: chains, the arguments of their model but the summaries, their starts, the settings."""

    chains: Chains
    arguments: Mapping[str, Any]
    starts: Mapping[str, Any]
    settings: SamplerSettings

    def run(self) -> Location:
        """Return where the posterior is."""
        self.settings.on_stage("posterior mode", None)
        location = first = Location(self.arguments["summaries"], self._unknown())
        for number in range(_ROUNDS_AT_MODE_OF_MANY if self._many else _ROUNDS_AT_MODE):
            location = self._about_mode(location, number) or first
            if location is first or location.error.at_least <= SUMMARY_ERROR_MOST:
                break
        least, most = _ROUNDS_OF_CHAINS
        for number in range(most):
            location = self._about_chunk(location, number)
            error = location.error
            undecided = 2.0 * error.chance > _BY_CHANCE_MOST**2
            by_slopes = undecided and self._many
            # Without any error, chance alone exceeds its own standard error in one round of six.
            small = error.total**2 <= SUMMARY_ERROR_MOST**2 + error.chance and not undecided
            if not np.isfinite(error.total) or (number + 1 >= least and (small or by_slopes)):
                break
        location = location._replace(sites=_NO_SITES)
        if not by_slopes or location.draws is None or not np.isfinite(error.total):
            return location
        return self._with_slope(location, location.draws, _OF_PILOT)

    def about(self, location: Location, draws: Draws, number: int) -> Location:
        """Return a location with its summaries made anew about draws, and its slope where it had one.

        `number` tells one such location from others.
        """
        about = self._located(draws.sites)._replace(draws=location.draws, covariance=location.covariance)
        if location.slope is None:
            return about
        return self._with_slope(about, self.chains.blocks.join(draws.unconstrained), number)

    def chains_at(self, location: Location, number: int) -> tuple[Chains, Begun]:
        """Return the chains with the summaries of a location, and the state in which they are there.

        Of their warmup the last chunk is left, and all beyond `_WARMUP_BY_PILOT` iterations; `number` tells one such
        state from others.
        """
        chains, done = self._given(location), max(min(self.settings.warmup - CHUNK, _WARMUP_BY_PILOT), 0)
        return chains, Begun(self._begin(chains, location, _ROUNDS_OF_CHAINS[1] + number, done), done)

    def error(self, location: Location, draws: Draws) -> SummaryError:
        """Return how far the summaries of a location, with its slope if it has one, are off at draws made with them."""
        if location.slope is None:
            return self._error(draws.sites)
        points = self.chains.blocks.join(draws.unconstrained)
        error = self._error(draws.sites, flat(points) @ location.slope)
        if not np.isfinite(error.total):
            return error
        return error.by_slopes(flat(self._slopes(location, points, _OF_ERROR)) - location.slope, flat(points))

    def _about_mode(self, location: Location, number: int) -> Location | None:
        """Return the location at the mode that there is with these summaries; None where there is none."""
        chains, seed = self._given(location), self.settings.seed
        start = chains.middle if location.draws is None else flat(location.draws).mean(axis=0)
        approximation = normal_approximation(chains.potential, start, chains.chains, location.covariance)
        if approximation is None:
            return None
        count = _DRAWS_AT_MODE_OF_MANY if self._many else CHUNK
        draws = approximation.draw(chains.chains * count, seed).reshape(chains.chains, count, -1)
        sites = chains.constrain(chains.blocks.split(draws), (seed, number))
        location = self._located(sites)._replace(draws=draws, covariance=approximation.covariance)
        return location if np.isfinite(location.error.total) else None

    def _about_chunk(self, location: Location, number: int) -> Location:
        """Return where the chains are after a chunk that begins at a location."""
        chains, settings = self._given(location), self.settings
        last = max(settings.warmup - CHUNK, 0)
        state = self._begin(chains, location, number, last)
        count = 1 if location.draws is not None else 1 + _APPROACH_CHUNKS
        settings.on_stage("pilot run", count * CHUNK)
        for _ in range(count):
            chunk = chains.advance(state, CHUNK)
            state = chunk.state
            settings.on_progress(CHUNK)
        sites = chains.constrain(chunk.unconstrained, (settings.seed, number))
        draws = chains.blocks.join(chunk.unconstrained)
        before = np.eye(draws.shape[-1]) if location.covariance is None else location.covariance
        count = len(flat(draws))
        share = count / (count + max(_COVARIANCE_DRAWS, len(before)))
        covariance = share * np.cov(flat(draws).T) + (1.0 - share) * before
        located = self._located(sites, location.sites)
        own = {name: sites[name] for name in _OF_SUMMARIES if name in sites}
        return located._replace(draws=draws, covariance=covariance, sites=own)

    def _located(self, sites: Mapping[str, np.ndarray], before: Mapping[str, np.ndarray] = _NO_SITES) -> Location:
        """Return summaries about draws of every site, and how far those were off that the draws were made with.

        They are about draws that were made `before`, with other summaries, as well: the more, the less is left to
        chance.
        """
        error = self._error(sites)
        both = {name: np.concatenate([draws, sites[name]], axis=1) for name, draws in before.items()}
        summaries = _summaries_about(both or sites, self.arguments)
        if not all(np.isfinite(np.asarray(leaf)).all() for leaf in jax.tree.leaves(summaries)):
            # Draws that are all one, of chains that stood still, are no posterior to go by.
            error = self._unknown()
        return Location(summaries, error)

    def _with_slope(
        self, location: Location, points: Float[np.ndarray, "chains draws unknowns"], number: int
    ) -> Location:
        """Return a location with the slope of what its summaries miss, as far as beyond chance at these points."""
        self.settings.on_stage("what the summaries miss", None)
        slopes = flat(self._slopes(location, points, number))
        # Of the summaries alone: what the regression could not tell.
        error = location.error._replace(at_least=0.0).by_slopes(slopes, flat(points))
        if not np.isfinite(error.total):
            return location._replace(error=error)
        mean, square = slopes.mean(axis=0), slopes.var(axis=0) / len(slopes)
        slope = mean * np.maximum(1.0 - _BEYOND_CHANCE * square / np.maximum(mean**2, _TINY), 0.0)
        return location._replace(slope=slope, error=error)

    def _slopes(
        self, location: Location, points: Float[np.ndarray, "chains draws unknowns"], number: int
    ) -> Float[np.ndarray, "chains some unknowns"]:
        """Return slopes of what the summaries of a location miss, at some of the points of each chain."""
        count = min(_DRAWS_OF_SLOPES, points.shape[1])
        some = points[:, np.linspace(0, points.shape[1] - 1, count).round().astype(int)]
        chains = self._given(location)
        # Draws of a chunk have seeds of two numbers, and a third that is zero counts as none.
        return chains.slopes(SUMMARY_ERROR, chains.blocks.split(some), (self.settings.seed, number, 1))

    def _given(self, location: Location) -> Chains:
        return self.chains.given({**self.arguments, "summaries": location.summaries}, self.starts, location.slope)

    def _begin(self, chains: Chains, location: Location, number: int, done: int) -> HMCState:
        if location.draws is None or location.covariance is None:
            return chains.begin(self.settings.seed)
        seed = int(np.random.SeedSequence((self.settings.seed, number)).generate_state(1)[0])
        return chains.begin_where(location.draws[:, -1], location.covariance, seed, done)

    def _error(self, sites: Mapping[str, np.ndarray], by_slopes: ArrayLike = 0.0) -> SummaryError:
        return summary_error(sites, self.chains.sampled, self._cases(), by_slopes)

    @property
    def _many(self) -> bool:
        return len(self.arguments["factors"].of_record) >= _MANY_RECORDS

    def _unknown(self) -> SummaryError:
        return SummaryError(np.inf, np.inf, self._cases()[0], np.inf)

    def _cases(self) -> list[str]:
        return [case.label for case in self.arguments["factors"].cases]


def _summaries_about(sites: Mapping[str, np.ndarray], arguments: Mapping[str, Any]) -> RecordSummaries:
    """Return summaries of the records about draws."""
    of_records = {name: flat(sites[name]) for name in ("k", "beta", "sigma", "rho") if name in sites}
    with np.errstate(divide="ignore", invalid="ignore"):  # far from the posterior: `_located` refuses such summaries
        log_values = np.log(np.stack([of_records["k"], of_records["beta"]], axis=-1))
        noise = [np.log(of_records["sigma"]), *([np.arctanh(of_records["rho"])] if "rho" in sites else [])]
    factors = arguments["factors"]
    mean_J = flat(sites["J_group"]).mean(axis=0)[factors.group.of_case[factors.of_record]]
    # The log likelihood of a record is nearly linear in the variance of J.
    sd_J = np.sqrt(np.mean(sites["sd_J"] ** 2))
    about = map(jnp.asarray, (log_values, np.stack(noise, axis=-1), mean_J, sd_J))
    return refine_summaries(arguments["data"], arguments["likelihood"], *about)
