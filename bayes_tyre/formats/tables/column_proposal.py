"""A proposal for the column map of a lab's table, from the names of its columns, their units and its directions."""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pandas as pd
import tomli_w

from bayes_tyre.formats.tables.column_map import OUR_COLUMNS, OUR_UNITS
from bayes_tyre.formats.tables.header import UNIT_ENDING, UNITS, UNITS_ROW, Layout, unit_of_name
from bayes_tyre.plain_text import quoted
from bayes_tyre.record import DIRECTIONS, REQUIRED

#: English and German names, as `_normalised` has them, by our column.
_NAMES = {
    "record": "record versuch versuchsname test testname messung run measurement",
    "displacement_mm": "displacement weg deflection einfederung verschiebung travel federweg stroke hub",
    "force_kN": "force kraft radkraft vertikalkraft verticalforce wheelforce fz",
    "load_kN": "zylinderlast pruefkraft prueflast pruefstandslast cylinderload",
    "time_s": "time zeit t messzeit timestamp",
    "configuration": "configuration konfiguration config reifen tyre tire bereifung variante",
    "direction": "direction richtung lastrichtung belastungsrichtung belastungentlastung loadingunloading",
    "speed_km_h": "speed geschwindigkeit velocity v tempo",
    "initial_load_kN": "initialload last load anfangslast ausgangslast startlast vorlast preload radlast",
    "step_kN": "step stufe laststufe lastsprung loadstep schritt",
    "repeat": "repeat wiederholung repetition wdh rep wiederholungsnummer wiederholungnr",
    "origin": "origin herkunft",
}
_OURS = {name: ours for ours, names in _NAMES.items() for name in names.split()}
_DIRECTIONS = {
    "loading": "loading load belastung belasten auf up",
    "unloading": "unloading unload entlastung entlasten ab down",
}
_OUR_DIRECTION = {name: ours for ours, names in _DIRECTIONS.items() for name in names.split()}
#: Most values that a column of directions has.
_MOST_VALUES = 10
_BRACKETS = re.compile(r"[\[(][^\[\]()]*[\])]\s*$")
_UMLAUTS = {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"}
#: What serves a file that lacks a name: it stands the same in every row.
_INSTEAD = {
    name: f'; if the whole file is one {name}, write {name} = "NAME" under [constants]' for name in ("record", "test")
}
#: Ends a map where no column says whether the rows were measured; reading it back changes nothing.
_ORIGIN = """
# No column states the origin of the data. Of measurements, take the two # below away:
#[constants]
#origin = "measured"
"""
_SLOW = ("test", "load_kN", "displacement_mm")


class Proposal(NamedTuple):
    """A column map as text, a sentence on each thing not placed, our required columns among them, and its command.

    `states_origin` is whether a column states the origin of the data.
    """

    toml: str
    unplaced: list[str]
    missing: list[str]
    command: str
    states_origin: bool


def layout_by_vocabulary() -> Layout:
    """Return a layout that finds the header by the names known here, and renames nothing."""
    return Layout(lambda name: name in OUR_COLUMNS or _our_name(name) is not None)


def propose(table: pd.DataFrame) -> Proposal:
    """Return a proposed column map of a table that was read with `layout_by_vocabulary`.

    A column is placed by its name, else by its unit if it is the only one left with it, and a column of directions by
    its values; two that could be the same are both left to the user. A table with a load but no force is taken for one
    of slow tests (`load-deflection`).
    """
    names = [str(name) for name in table.columns]
    could_be = {name: _our_name(name) or ("direction" if _are_directions(table[name]) else None) for name in names}
    by_unit = {name: _our_by_unit(_unit(name, table), could_be) for name in names if could_be[name] is None}
    for name, ours in by_unit.items():
        could_be[name] = ours if [*by_unit.values()].count(ours) == 1 else None
    if slow := _is_slow(table, could_be):
        slow_names = {"record": "test", "initial_load_kN": "load_kN"}
        could_be = {name: slow_names.get(str(ours), ours) for name, ours in could_be.items()}
    return _proposal(table, could_be, _SLOW if slow else REQUIRED)


def _is_slow(table: pd.DataFrame, could_be: Mapping[str, str | None]) -> bool:
    """Return whether a table has no force, but a load that varies within its tests, as an initial load does not."""
    names = {ours: name for name, ours in could_be.items()}
    load = names.get("load_kN") or names.get("initial_load_kN")
    if "force_kN" in names or load is None:
        return False
    test = names.get("test") or names.get("record")
    levels = table[load].nunique() if test is None else table.groupby(test)[load].nunique().max()
    return bool(levels > 1)


def _proposal(table: pd.DataFrame, could_be: Mapping[str, str | None], required: Sequence[str]) -> Proposal:
    columns: dict[str, object] = {}
    unplaced: list[str] = []
    directions, unknown = _directions(table, could_be)
    for name, ours in could_be.items():
        unit = _unit(name, table)
        if ours is None or (why := _why_not(ours, unit, [*could_be.values()])):
            unplaced.append(f"column {quoted(name)}: {'stays as a further column' if ours is None else why}")
            continue
        plain = unit in ("", OUR_UNITS.get(ours, unit)) or table.attrs.get(UNITS_ROW, {}).get(name)
        further: dict[str, object] = {} if plain or name == ours else {"unit": unit}
        if ours == "step_kN" and _unloads(table, could_be, directions) and _are_unsigned(table[name]):
            further["unsigned"] = True
        if further or name != ours:
            columns[ours] = {"name": name, **further} if further else name
    unplaced += unknown
    missing = [ours for ours in required if ours not in columns and ours not in table]
    unplaced += [f"{ours}: required, and no column found for it{_INSTEAD.get(ours, '')}" for ours in missing]
    named = {*columns, *map(str, table.columns)}
    if required is REQUIRED and "direction" in named and "initial_load_kN" not in named:
        unplaced.append(
            "initial_load_kN: no column found for it; loading and unloading are not compared without: add one to the "
            "table, or put it under [constants] where all records start from one load"
        )
    command = "lsq" if required is REQUIRED else "load-deflection"
    content = {"columns": columns, **({"values": {"direction": directions}} if directions else {})}
    comments = "".join(f"# not placed: {text}\n" for text in unplaced)
    states_origin = "origin" in could_be.values()
    toml = comments + tomli_w.dumps(content) + ("" if states_origin else _ORIGIN)
    return Proposal(toml, unplaced, missing, command, states_origin)


def _why_not(ours: str, unit: str, all_ours: Sequence[str | None]) -> str:
    """Return why a column is not placed though it could be one of ours; empty where it is."""
    if all_ours.count(ours) > 1:
        return f"{ours}, as {all_ours.count(ours)} columns could be; choose one"
    accepted = UNITS.get(OUR_UNITS.get(ours, ""), {unit: 1.0})
    return f"{ours}, but not in {', '.join(accepted)}; convert it first" if unit and unit not in accepted else ""


def _normalised(text: str) -> str:
    """Return letters and digits alone, lower case, umlauts written out; without a unit at the end."""
    bare = unicodedata.normalize("NFC", UNIT_ENDING.sub("", _BRACKETS.sub("", text).strip()).lower())
    return re.sub(r"[^a-z0-9]", "", "".join(_UMLAUTS.get(letter, letter) for letter in bare))


def _our_name(name: str) -> str | None:
    return name if name in OUR_COLUMNS else _OURS.get(_normalised(name))


def _unit(name: str, table: pd.DataFrame) -> str:
    """Return the unit of a column by the row of units, brackets in its name, or the end of its name."""
    return table.attrs.get(UNITS_ROW, {}).get(name, "") or unit_of_name(name)


def _our_by_unit(unit: str, could_be: Mapping[str, str | None]) -> str | None:
    """Return the one of displacement, force and time that has such a unit, unless another column is it by name."""
    ours = next((one for one in ("displacement_mm", "force_kN", "time_s") if unit in UNITS[OUR_UNITS[one]]), None)
    taken = {"force_kN", "load_kN"} if ours == "force_kN" else {ours}
    return None if taken & {*could_be.values()} else ours


def _are_unsigned(steps: pd.Series) -> bool:
    return bool((pd.to_numeric(steps, errors="coerce") > 0).all())


def _unloads(table: pd.DataFrame, could_be: Mapping[str, str | None], directions: Mapping[str, str]) -> bool:
    """Return whether some row of a table is of unloading."""
    theirs = {label for name, ours in could_be.items() if ours == "direction" for label in _labels(table[name])}
    return "unloading" in {directions.get(label, label) for label in theirs}


def _labels(cells: pd.Series) -> list[str]:
    return list(dict.fromkeys(str(cell).strip() for cell in cells.dropna().unique()[: _MOST_VALUES + 1]))


def _are_directions(cells: pd.Series) -> bool:
    labels = [] if pd.api.types.is_float_dtype(cells) else _labels(cells)
    return 0 < len(labels) <= _MOST_VALUES and all(_normalised(label) in _OUR_DIRECTION for label in labels)


def _directions(table: pd.DataFrame, could_be: Mapping[str, str | None]) -> tuple[dict[str, str], list[str]]:
    """Return our direction by theirs, and a sentence on each value that is neither."""
    theirs = [label for name, ours in could_be.items() if ours == "direction" for label in _labels(table[name])]
    ours_by_label = {label: _OUR_DIRECTION.get(_normalised(label)) for label in theirs if label not in DIRECTIONS}
    unknown = [label for label, ours in ours_by_label.items() if ours is None]
    sentences = [f"direction {quoted(label)}: loading or unloading? say so in [values.direction]" for label in unknown]
    return {label: ours for label, ours in ours_by_label.items() if ours is not None}, sentences
