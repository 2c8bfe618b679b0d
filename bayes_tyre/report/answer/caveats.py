"""What not to believe: what a result does not support, a sentence each, from what its folder says."""

from collections.abc import Iterator
from typing import NamedTuple

from bayes_tyre.plain_text import listed
from bayes_tyre.record import EITHER_LAW, ORIGIN_UNKNOWN
from bayes_tyre.report.answer.formatting import interval_name, label, probability, ratio_text
from bayes_tyre.report.answer.headline import STIFFNESS, prior_clause
from bayes_tyre.report.answer.load import Reported
from bayes_tyre.report.answer.losses import losses_caveats
from bayes_tyre.report.answer.ratios import SAME_LOAD, SAME_SPAN, Ratio, between_configurations, between_directions
from bayes_tyre.report.wording import text_name


class Caveat(NamedTuple):
    """What a reader should not believe, and why: a noun phrase and a clause, together a sentence."""

    what: str
    why: str

    @property
    def sentence(self) -> str:
        """Both, as one sentence."""
        return f"{self.what}: {self.why}"


#: Each kind of data, for a reader who sees nothing but the page; anything that is no measurement is marked.
ORIGINS = {
    "measured": "Measured: records from a test rig.",
    "published": "Published: numbers as printed in a source, not measured anew.",
    "reconstructed": "Reconstructed: records made from printed tables. They are not measurements.",
    "simulated": "Simulated: records computed from a model. They are not measurements.",
    ORIGIN_UNKNOWN: "Origin not stated: the records do not say whether they were measured.",
}
_WEIGHT = {
    "published": Caveat(
        "Anything beyond the printed numbers",
        "whatever their processing did to them is in these results too. The source leaves out the axle's inertia and "
        "smooths a response of 40 ms over 80 ms, so its beta may be the filter's rather than the tyre's.",
    ),
    "reconstructed": Caveat(
        "These intervals as those of a measurement",
        "the records were made from printed means with assumed repeats and noise, and show what such records would "
        "support.",
    ),
    "simulated": Caveat("These numbers as a tyre's", "the records were computed from a model, and show that model."),
    ORIGIN_UNKNOWN: Caveat(
        "That these are measurements",
        "the records do not state their origin. Where they are, give them a column origin that holds measured, or put "
        'origin = "measured" under [constants] in the column map.',
    ),
}
#: Laws along a record in words, by the option `--law`.
_LAWS = {"equation_2": "Equation 2", "small_step_limit": "its limit for small steps"}
#: Above this a record is more likely discordant than not; the most that are named.
_DISCORDANT, _NAMED = 0.5, 5


def origin_sentence(origin: str) -> str:
    """Return what a kind of data is."""
    return ORIGINS.get(origin, label(origin))


def caveats(result: Reported) -> list[str]:
    """Return what a reader of the result should not believe, a sentence each."""
    return [caveat.sentence for caveat in caveats_of(result)]


def caveats_of(result: Reported) -> list[Caveat]:
    """Return what a reader of the result should not believe, the most harmful first."""
    return [
        *_of_verdict(result),
        *(_WEIGHT[origin] for origin in result.origins if origin in _WEIGHT),
        *_of_law(result),
        *_of_configurations(result),
        *_of_directions(result),
        *_of_priors(result),
        *_of_repeats(result),
        *(Caveat(*losses) for losses in (losses_caveats(result) if result.of_motions else ())),
    ]


def _of_verdict(result: Reported) -> Iterator[Caveat]:
    if result.verdict == "fail":
        yield Caveat("Any number of this result", "the fit failed its checks, and another run may say something else.")


def _of_law(result: Reported) -> Iterator[Caveat]:
    for limitation in result.sentences("limitations"):
        if limitation.startswith(EITHER_LAW):
            text = limitation.removeprefix(EITHER_LAW)
            for name, words in _LAWS.items():
                text = text.replace(name, words)
            yield Caveat("The interval of beta as one for either law", f"the records do not tell {text}.")


def _of_configurations(result: Reported) -> Iterator[Caveat]:
    for parameter in result.cases["parameter"].unique():
        for ratio in between_configurations(result, str(parameter)):
            if not ratio.clear:
                pair = f"{label(ratio.above)} and {label(ratio.below)}"
                yield Caveat(f"A difference in {label(text_name(parameter))} between {pair}", f"{_holds_1(ratio)}.")


def _holds_1(ratio: Ratio) -> str:
    return (
        f"the {interval_name(ratio.interval)} of their ratio, {ratio_text(ratio.lower)} to {ratio_text(ratio.upper)}, "
        f"contains 1, and the probability that it is above 1 is {probability(ratio.p_greater_than_1)}"
    )


def _of_directions(result: Reported) -> Iterator[Caveat]:
    ratios = between_directions(result, STIFFNESS)
    if len(ratios) == 2:
        span, load = (ratios[matching] for matching in (SAME_SPAN, SAME_LOAD))
        yield Caveat(
            "One number for loading against unloading",
            f"it is {ratio_text(span.median)} over the same span of load and {ratio_text(load.median)} from the same "
            "initial load, for load and direction change together.",
        )
    if (result.contrasts["matching"] == "pooled as published").any():
        yield Caveat(
            "The contrasts called \u201cpooled as published\u201d",
            "they compare unlike cases (other speeds, loads and steps in loading than in unloading) and stand there "
            "only beside the source's own numbers.",
        )


def _of_priors(result: Reported) -> Iterator[Caveat]:
    clauses = [prior_clause(result, str(parameter)) for parameter in result.cases["parameter"].unique()]
    if any(clauses):
        yield Caveat("That the data alone decide every mean", f"{'; '.join(filter(None, clauses))}.")


def _of_repeats(result: Reported) -> Iterator[Caveat]:
    records = result.repeats.drop_duplicates("record")
    if records.empty:
        return
    discordant = records[records["outlier_probability"] > _DISCORDANT].sort_values(
        "outlier_probability", ascending=False
    )
    if len(discordant):
        named = listed(discordant["record"].tolist(), _NAMED, lambda record: label(record, 40))
        yield Caveat("A record by itself that does not agree with the other repeats of its case", f"{named}.")
    if records["outlier_probability"].isna().all():
        yield Caveat(
            "That no record is discordant", "no case has the three repeats, or the fit the model, that could tell."
        )
