"""`report.html`: one page that holds all it shows, from results on disk; the same results give the same bytes."""

import base64
import hashlib
import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from unicodedata import category

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from bayes_tyre.inference.model.default_priors import PRIORS
from bayes_tyre.report.answer.caveats import caveats, origin_sentence
from bayes_tyre.report.answer.formatting import interval_name, label, rounded
from bayes_tyre.report.answer.headline import STIFFNESS, comparison_of, headline
from bayes_tyre.report.answer.load import Reported
from bayes_tyre.report.answer.quantities import in_words
from bayes_tyre.report.answer.ratios import UNLIKE_CASES, unlike_cases
from bayes_tyre.report.answer.unchecked import unchecked
from bayes_tyre.report.html import tables
from bayes_tyre.report.html.between_results import Comparison
from bayes_tyre.report.html.figures import EmbeddedFigure
from bayes_tyre.report.html.glossary import glossary
from bayes_tyre.report.html.letterhead import NONE, Letterhead
from bayes_tyre.report.html.tables import Cell, Column, Table
from bayes_tyre.report.limits import MOST_SENTENCES, limit_sentences
from bayes_tyre.report.wording import probability_text, text_name

TEMPLATES = Path(__file__).parents[1] / "templates"
VERDICTS = {
    "pass": "Verdict: pass. The checks of the fit found nothing against these numbers.",
    "fail": "Verdict: fail. Do not use these numbers.",
}
#: The figures of `diagnostics.json` that stand under how a result was made, and what they are called there.
CHECKS = {
    "r_hat_max": "largest R-hat",
    "ess_bulk_min": "smallest bulk ESS",
    "ess_tail_min": "smallest tail ESS",
    "bfmi_min": "smallest BFMI",
    "divergences": "divergences",
}
#: Kinds of characters that show nothing, and may change how others are shown.
_UNSEEN = ("Cc", "Cf", "Cn", "Co", "Cs")
#: The most letters of what `run.json` says.
_LONG = 2000


class Part(NamedTuple):
    """A result for the document: its tables, its figures, and what to say of figures that are not there."""

    result: Reported
    figures: Sequence[EmbeddedFigure]
    note: str = ""


def document(parts: Sequence[Part], comparisons: Sequence[Comparison] = (), head: Letterhead = NONE) -> str:
    """Return the page.

    Parameters
    ----------
    parts:
        The results, one or more; they stand side by side.
    comparisons:
        The ratios of the first to each of the others.
    head:
        What stands above it.
    """
    results = [part.result for part in parts]
    made = [tables.means_table, tables.contrasts_table, tables.cases_table, tables.repeats_table]
    if any(result.of_motions for result in results):
        made.insert(3, tables.losses_table)
    if any(result.laws is not None for result in results):
        made.append(tables.laws_table)
    means, *long_tables = [make(results) for make in made]
    return rendered(
        "report.html.j2",
        head,
        title=_title(results),
        parts=[_shown(part) for part in parts],
        comparisons=_comparisons_shown(comparisons, results[0].interval),
        means=means,
        unlike=UNLIKE_CASES if any(unlike_cases(result) for result in results) else "",
        tables=[table for table in long_tables if table.rows],
        without=[table.caption for table in long_tables if not table.rows],
        interval=_intervals(results),
        figures=_figures(parts),
        made=_made_table(results),
        glossary=glossary(results),
    )


def rendered(template: str, head: Letterhead, *, title: str, **values: Any) -> str:
    """Return a page of a template: its values, style, script and version; values are text, never markup."""
    loader = FileSystemLoader(TEMPLATES)
    templates = Environment(
        loader=loader,
        autoescape=True,
        finalize=_seen,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style, *scripts = (
        Markup((TEMPLATES / name).read_text(encoding="utf-8")) for name in ("report.css", "sort.js", "save.js")
    )
    script = Markup("\n").join(scripts)
    page = templates.get_template(template)
    fixed = {"style": style, "script": script, "policy": _policy(style, script), "version": version("bayes-tyre")}
    return page.render(head=head, title=head.titled(title), **fixed, **values)


def _seen(value: Any) -> Any:
    """Return a text with U+FFFD for what is not seen: marks of direction, characters without width, controls."""
    if not isinstance(value, str) or isinstance(value, Markup) or value.isprintable():
        return value
    return "".join("\N{REPLACEMENT CHARACTER}" if category(c) in _UNSEEN and c != "\n" else c for c in value)


def _policy(style: str, script: str) -> str:
    """Return a content security policy: this style, this script, images inside the page, and nothing else."""

    def sha(text: str) -> str:
        return base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")

    allowed = f"style-src 'sha256-{sha(style)}'; script-src 'sha256-{sha(script)}'; img-src data:"
    return f"default-src 'none'; {allowed}; base-uri 'none'; form-action 'none'"


def _title(results: Sequence[Reported]) -> str:
    named = dict.fromkeys(label(each, 40) for result in results for each in result.configurations if each)
    about = "Tyre stiffness, friction and energy lost" if all(one.of_motions for one in results) else "Tyre stiffness"
    return f"{about}: {', '.join(named)}" if named else about


def _shown(part: Part) -> dict[str, Any]:
    result = part.result
    return {
        "name": label(result.name),
        "verdict": result.verdict,
        "verdict_sentence": VERDICTS[result.verdict],
        "reasons": [label(in_words(each), _LONG) for each in result.sentences("reasons")],
        "limitations": [label(in_words(each), _LONG) for each in result.sentences("limitations")],
        "origins": [(each, origin_sentence(each)) for each in result.origins],
        "headline": [*headline(result), *limit_sentences(result.cases, MOST_SENTENCES)],
        "caveats": caveats(result),
        "unchecked": tuple(unchecked(result)),
        "note": part.note,
    }


def _intervals(results: Sequence[Reported]) -> str:
    """Return which interval the tables give, where results have different ones that of each."""
    named = [(interval_name(result.interval), label(result.name)) for result in results]
    different = len({interval for interval, _ in named}) > 1
    return ", ".join(f"{interval} of {name}" for interval, name in named) if different else named[0][0]


def _comparisons_shown(comparisons: Sequence[Comparison], interval: float) -> dict[str, Any]:
    ratios = [
        (text_name(parameter), ratio) for each in comparisons for parameter, of in each.ratios.items() for ratio in of
    ]
    columns = [Column("", name, "", number=False) for name in ("parameter", "above", "below")]
    columns += [Column("", name, "", number=True) for name in ("ratio", "P(ratio > 1)")]
    rows = [
        [
            *(Cell(label(text), text) for text in (parameter, ratio.above, ratio.below)),
            tables.with_reach(ratio.median, ratio.lower, ratio.upper),
            tables.number(ratio.p_greater_than_1, probability_text),
        ]
        for parameter, ratio in ratios
    ]
    sentences = [
        comparison_of(ratio, "averaged over the test cases of both")
        for parameter, ratio in ratios
        if parameter == STIFFNESS
    ]
    caption = f"Ratios between the results, averaged over the cases of both: median and {interval_name(interval)}"
    return {
        "sentences": sentences,
        "limitations": [each.limitation for each in comparisons if each.limitation],
        "table": Table("ratios", caption, columns, rows),
    }


def _figures(parts: Sequence[Part]) -> list[dict[str, Any]]:
    """Return the figures by name, in the order of the first result that has each; those of one name stand together."""
    by_name: dict[str, list[tuple[str, EmbeddedFigure]]] = {}
    for part in parts:
        for figure in part.figures:
            by_name.setdefault(figure.name, []).append((label(part.result.name), figure))
    return [
        {"heading": shown[0][1].heading, "reading": shown[0][1].reading, "shown": shown} for shown in by_name.values()
    ]


def _made_table(results: Sequence[Reported]) -> list[tuple[str, list[str]]]:
    """Return how the results were made: a row a fact, a text a result."""
    facts: dict[str, list[str]] = {}
    for i, result in enumerate(results):
        for name, value in _made(result).items():
            facts.setdefault(name, [""] * len(results))[i] = label(value, _LONG)
    return list(facts.items())


def _priors(given: dict[str, Any]) -> str:
    """Return what differs from the default priors."""
    changes = PRIORS.changed(given).changes_from(PRIORS)
    texts = {name: given if not isinstance(given, dict) else _parameters(given) for name, given in changes.items()}
    return ", ".join(f"{name} {text}" for name, text in texts.items()) or "the defaults"


def _option(value: object) -> str:
    """Return the value of an option as a reader expects it: yes and no, lists and mappings as JSON has them."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, dict | list) else str(value)


def _parameters(prior: dict[str, Any]) -> str:
    family, *parameters = prior.items()
    return f"{family[1]} ({', '.join(f'{name} {value:g}' for name, value in parameters)})"


def _made(result: Reported) -> dict[str, str]:
    run, checks = result.run, result.diagnostics
    options = {name: value for name, value in run["options"].items() if name != "priors"}
    figures = {name: checks[key] for key, name in CHECKS.items() if isinstance(checks.get(key), int | float)}
    return {
        "command": run["command"],
        "seed": str(run["seed"]),
        "options": ", ".join(f"{name} {_option(value)}" for name, value in options.items() if value is not None),
        "priors": _priors(run["options"].get("priors", {})),
        **{f"SHA-256 of {label(Path(path).name, 60)}": str(digest) for path, digest in run["inputs"].items()},
        "versions": ", ".join(f"{name} {used}" for name, used in run["versions"].items()),
        "checks": ", ".join(f"{name} {rounded(float(value))}" for name, value in figures.items()),
        "time it took": f"{rounded(float(run['wall_time_s']))} s",
    }
