"""The figures draw what the tables hold, say where it comes from, and take any label and any missing word."""

from itertools import pairwise, product

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from bayes_tyre.report import colours, figures

WORDS = ["configuration", "direction", "speed_km_h", "initial_load_kN", "step_kN"]
HOSTILE = ["a$b_c$", "<script>alert(1)</script>", "_hidden", "x" * 300, "two\nlines \x00", "$\\frac{", "四輪", ""]
FOUR = ("posteriors_by_direction", "forest_of_cases", "records_with_bands", "outlier_probabilities")


def _words(configurations=("single", "dual"), speeds=(0.0, 25.0)) -> pd.DataFrame:
    steps = (("loading", 10.0, 5.0), ("loading", 20.0, 10.0), ("unloading", 30.0, -10.0))
    rows = [(c, d, v, load, step) for c in configurations for v in speeds for d, load, step in steps]
    return pd.DataFrame(rows, columns=WORDS)


def _printed(**words) -> pd.DataFrame:
    table = _words(**words)
    return table.assign(k_kN_per_mm=np.linspace(1.4, 2.6, len(table)), beta_mm=np.geomspace(0.005, 0.1, len(table)))


def _cases(**words) -> pd.DataFrame:
    printed = _printed(**words)
    blocks = [
        printed[WORDS].assign(parameter=parameter, unit=unit, median=printed[column] * 1.01)
        for parameter, unit, column in (("k", "kN/mm", "k_kN_per_mm"), ("beta", "mm", "beta_mm"))
    ]
    table = pd.concat(blocks, ignore_index=True)
    return table.assign(lower=table["median"] * 0.9, upper=table["median"] * 1.1, interval=0.95, verdict="pass")


def _cells(configurations=("single", "dual"), spread=0.05, draws=200) -> pd.DataFrame:
    rng = np.random.default_rng(5)
    blocks = []
    scales = (("k", "kN/mm", 1.8), ("beta", "mm", 0.03))
    for name, direction, (parameter, unit, middle) in product(configurations, ("loading", "unloading"), scales):
        words = {"configuration": name, "direction": direction, "parameter": parameter, "unit": unit}
        blocks.append(pd.DataFrame({**words, "value": middle * np.exp(spread * rng.normal(size=draws))}))
    return pd.concat(blocks, ignore_index=True)


def _repeats(**words) -> pd.DataFrame:
    table = _words(**words).loc[lambda t: t.index.repeat(3)].reset_index(drop=True)
    probability = np.linspace(0.001, 0.2, len(table))
    probability[4] = 0.97
    names = [f"record {i}" for i in range(len(table))]
    return table.assign(record=names, repeat=np.arange(len(table)) % 3 + 1, outlier_probability=probability)


def _records(names=("first", "second"), points=60) -> tuple[pd.DataFrame, pd.DataFrame]:
    u = 4 * (1 - np.cos(np.linspace(0, np.pi, points))) / 2
    force = 20 + (0.4 + 1.8 * u) * -np.expm1(-u / 0.03)
    noise = 0.03 * np.random.default_rng(1).normal(size=points)
    measured = pd.DataFrame({"displacement_mm": 12 + u, "force_kN": force + noise})
    band = measured[["displacement_mm"]].assign(median_kN=force, lower_kN=force - 0.06, upper_kN=force + 0.06)
    tables = (pd.concat([one.assign(record=name) for name in names], ignore_index=True) for one in (measured, band))
    return next(tables), next(tables)


def _draw(name: str, origin: str = "reconstructed", configurations=("single", "dual")) -> Figure:
    words = {"configurations": configurations}
    tables = {
        "posteriors_by_direction": lambda: [_cells(configurations)],
        "forest_of_cases": lambda: [_cases(**words), _printed(**words)],
        "records_with_bands": lambda: _records(configurations),
        "outlier_probabilities": lambda: [_repeats(**words)],
    }[name]()
    before = [table.copy(deep=True) for table in tables]
    figure = getattr(figures, name)(*tables, origin)
    for table, copy in zip(tables, before, strict=True):
        pd.testing.assert_frame_equal(table, copy)
    return figure


def _said(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if isinstance(text, Text) and text.get_visible()]


def _markers(ax: Axes, *markers: str) -> np.ndarray:
    """Return x and y of everything drawn with the markers, shape (drawn, 2)."""
    return np.concatenate([np.asarray(line.get_xydata()) for line in ax.lines if line.get_marker() in markers])


def _segments(ax: Axes) -> list[np.ndarray]:
    drawn = [c for c in ax.collections if isinstance(c, LineCollection) and c.get_transform() == ax.transData]
    return [segment for collection in drawn for segment in collection.get_segments()]


@pytest.mark.parametrize("name", FOUR)
def test_axes_carry_units_and_a_corner_says_the_origin(name):
    figure = _draw(name, "reconstructed")
    assert "data: reconstructed, not measured" in _said(figure)
    units = ("mm", "kN", "no unit")
    for ax in (ax for ax in figure.get_axes() if ax.get_visible()):
        place = ax.get_subplotspec()
        assert any(unit in ax.get_xlabel() for unit in units)
        assert any(unit in ax.get_ylabel() for unit in units) or (place and not place.is_first_col())
        assert all(isinstance(inset, Axes) and "mm, kN" in inset.get_title() for inset in ax.child_axes)


@pytest.mark.parametrize(
    ("origin", "note"),
    [
        ("reconstructed", "data: reconstructed, not measured"),
        ("simulated", "data: simulated, not measured"),
        ("published", "data: published tables"),
        ("measured + simulated", "data: measured; simulated, not measured"),
        ("origin not stated", "data: origin not stated"),
        ("", "data: origin not stated"),
    ],
)
def test_the_origin_is_said_plainly(origin, note):
    assert colours.origin_note(origin) == note


@pytest.mark.parametrize("name", FOUR)
def test_nothing_outside_is_changed(name):
    before = dict(matplotlib.rcParams)
    _draw(name)
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("name", FOUR)
def test_any_label_is_drawn_as_plain_text(name, tmp_path):
    figure = _draw(name, configurations=HOSTILE)
    figures.save(figure, tmp_path / "figure.png")
    for label in HOSTILE[:6]:
        assert any(text.startswith(colours.plain(label, 24)[:10]) for text in _said(figure))


def test_plain_text_escapes_mathtext_and_shortens_what_is_long():
    assert colours.plain("a$b$") == r"a\$b\$"
    assert colours.plain("two\n lines") == "two lines"
    assert colours.plain("四") == r"\u56db"
    assert len(colours.plain("y" * 500)) == 40


def test_a_configuration_looks_the_same_in_every_figure():
    look = colours.looks(["single", "dual"])
    for order in (("single", "dual"), ("dual", "single")):
        for name in ("posteriors_by_direction", "forest_of_cases", "outlier_probabilities"):
            figure = _draw(name, configurations=order)
            lines = [line for ax in figure.get_axes() for line in ax.lines if line.get_marker() in ("o", "s", "^")]
            drawn = {(to_rgb(line.get_color()), line.get_marker()) for line in lines}
            assert drawn == {(to_rgb(one.colour), one.marker) for one in look.values()}


def test_looks_differ_for_many_configurations_and_neighbours_differ_in_every_way():
    look = list(colours.looks(f"{i:03d}" for i in range(210)).values())
    assert len({(one.colour, one.marker, one.line) for one in look}) == 210
    for one, following in pairwise(look):
        assert all(mine != other for mine, other in zip(one, following, strict=True))


def test_posteriors_show_a_density_and_an_interval_for_each_configuration_and_direction():
    cells = _cells(("a", "b", "c"))
    figure = figures.posteriors_by_direction(cells, "measured", 0.9)
    assert any("90 % interval" in text for text in _said(figure))
    axes = figure.get_axes()
    assert [ax.get_title() for ax in axes] == ["loading", "unloading", "", ""]
    for ax in axes:
        assert sum(isinstance(c, PolyCollection) for c in ax.collections) == 3
    chosen = cells.query("configuration == 'b' and direction == 'loading' and parameter == 'k'")["value"]
    look = colours.looks("abc")["b"]
    bars = [np.asarray(line.get_xydata()) for line in axes[0].lines if line.get_color() == look.colour]
    ends = next(bar[:, 0] for bar in bars if len(bar) == 2)
    np.testing.assert_allclose(ends, np.quantile(chosen, [0.05, 0.95]))


@pytest.mark.parametrize(("spread", "scale"), [(0.05, "linear"), (1.0, "log")])
def test_beta_stands_on_a_logarithmic_axis_when_it_spreads_over_more_than_a_decade(spread, scale):
    axes = figures.posteriors_by_direction(_cells(spread=spread), "measured").get_axes()
    assert [ax.get_xscale() for ax in axes] == ["linear", "linear", scale, scale]


def test_posteriors_of_one_configuration_without_words():
    figure = figures.posteriors_by_direction(_cells(("single",)).drop(columns=WORDS[:2]), "measured")
    assert {"configuration not stated", "direction not stated"} <= set(_said(figure))
    assert figures.posteriors_by_direction(_cells(("single",)).assign(value=0.5), "measured").get_axes()


def test_the_forest_holds_every_case_its_interval_and_its_printed_value():
    cases, printed = _cases(), _printed()
    left, right = figures.forest_of_cases(cases, printed, "published").get_axes()
    for ax, parameter, column in ((left, "k", "k_kN_per_mm"), (right, "beta", "beta_mm")):
        mine = cases[cases["parameter"] == parameter]
        ends = np.array([segment[:, 0] for segment in _segments(ax)])
        np.testing.assert_allclose(np.sort(ends[:, 0]), np.sort(mine["lower"]))
        np.testing.assert_allclose(np.sort(ends[:, 1]), np.sort(mine["upper"]))
        medians = {y: x for x, y in _markers(ax, "o", "s")}
        open_ones = {y: x for x, y in _markers(ax, "D")}
        assert sorted(open_ones.values()) == pytest.approx(sorted(printed[column]))
        assert {y: x * 1.01 for y, x in open_ones.items()} == pytest.approx(medians)
    labels = [label.get_text() for label in left.get_yticklabels()]
    assert labels[:3] == ["dual, loading", "(0)10-15", "(0)20-30"]
    assert labels.count("(25)30-20") == 2
    assert right.get_xscale() == "log"


def test_a_forest_of_many_cases_stays_below_the_tallest_and_names_what_fits():
    cases = _cases(speeds=np.arange(150.0))
    figure = figures.forest_of_cases(cases, None, "simulated", "They are of something else.")
    assert any("They are of something else." in text.get_text() for text in figure.texts)
    assert figure.get_figheight() == figures.TALLEST
    ax = figure.get_axes()[0]
    assert len(_segments(ax)) == len(cases) / 2
    boxes = [label.get_window_extent() for label in ax.get_yticklabels()]
    assert all(above.y0 >= below.y1 - 1 for above, below in pairwise(boxes))


@pytest.mark.parametrize(
    ("words", "how"), [*(([word], "nan") for word in WORDS), (WORDS, "absent"), (WORDS, "empty"), (WORDS[2:], "absent")]
)
def test_missing_words_do_not_stop_a_figure(words, how):
    blank = {"nan": np.nan, "empty": ""}

    def without(table: pd.DataFrame) -> pd.DataFrame:
        return table.drop(columns=words) if how == "absent" else table.assign(**dict.fromkeys(words, blank[how]))

    forest = figures.forest_of_cases(without(_cases()), without(_printed()), "measured")
    assert len(_segments(forest.get_axes()[0])) == len(_words())
    figure = figures.outlier_probabilities(without(_repeats()), "measured")
    assert sum(len(_markers(ax, "o", "s")) for ax in figure.get_axes()) == 36


def test_printed_values_without_a_case_are_left_out_and_cases_without_one_stay():
    left, _ = figures.forest_of_cases(_cases(speeds=(0.0,)), _printed(speeds=(0.0, 35.0))[1:], "published").get_axes()
    assert np.isfinite(_markers(left, "D")[:, 0]).tolist().count(True) == 5


def test_records_show_points_band_and_residuals_of_six_at_most():
    points, bands = _records([f"r{i}" for i in range(8)])
    figure = figures.records_with_bands(points, bands, "reconstructed")
    titles = [ax.get_title() for ax in figure.get_axes() if ax.get_title()]
    assert titles == [f"r{i}" for i in range(6)]
    assert any("first 6 of 8 records" in text for text in _said(figure))
    above, below = figure.get_axes()[:2]
    assert len(_markers(above, "o")) == 60
    np.testing.assert_allclose(_markers(below, "o")[:, 1], (points["force_kN"] - bands["median_kN"])[:60])
    assert below.get_xscale() == "log"


def test_records_with_a_coarser_band_or_none():
    points, bands = _records(["known", "unknown"], points=400)
    coarse = bands[bands["record"] == "known"].iloc[::4]
    figure = figures.records_with_bands(points, coarse, "measured")
    expected = (points["force_kN"] - bands["median_kN"])[:400]
    np.testing.assert_allclose(_markers(figure.get_axes()[1], "o")[:, 1], expected, atol=0.01)
    assert any("no residuals" in text for text in _said(figure))


def test_outliers_are_named_and_missing_probabilities_are_said():
    repeats = _repeats()
    said = _said(figures.outlier_probabilities(repeats, "reconstructed"))
    assert said.count("repeat 2") == 1
    assert not any("no marker" in text for text in said)
    two = repeats[repeats["repeat"] < 3].assign(outlier_probability=np.nan)
    said = _said(figures.outlier_probabilities(two, "measured"))
    assert any("24 of 24 records have no marker: fewer than three repeats." in text for text in said)
    said = _said(figures.outlier_probabilities(repeats.assign(outlier_probability=np.nan), "measured"))
    assert any("or a model that gives none" in text for text in said)


def test_outliers_without_words_are_named_by_record():
    figure = figures.outlier_probabilities(_repeats()[["record", "outlier_probability"]], "measured")
    assert len(figure.get_axes()[0].get_yticklabels()) == 36
    assert _said(figure).count("record 4") == 2


def test_a_failed_verdict_is_said():
    for verdict in ("pass", "fail"):
        said = _said(figures.forest_of_cases(_cases().assign(verdict=verdict), None, "measured"))
        assert ("verdict: fail, not to be trusted" in said) == (verdict == "fail")


def test_tables_without_rows_give_a_figure():
    points, bands = _records()
    assert figures.posteriors_by_direction(_cells().iloc[:0], "measured").get_axes()
    assert figures.forest_of_cases(_cases().iloc[:0], _printed(), "measured").get_axes()
    assert figures.records_with_bands(points.iloc[:0], bands.iloc[:0], "measured")
    assert figures.outlier_probabilities(_repeats().iloc[:0], "measured").get_axes()


def test_saved_files_are_the_same_each_time_and_whole(tmp_path):
    one, two = (figures.save(_draw("forest_of_cases"), tmp_path / "new" / f"{i}.png") for i in (1, 2))
    assert one.read_bytes() == two.read_bytes()
    with Image.open(one) as picture:
        assert (picture.format, picture.width, "Software" in picture.info) == ("PNG", 8 * 150, False)
    assert sorted(path.name for path in one.parent.iterdir()) == ["1.png", "2.png"]
