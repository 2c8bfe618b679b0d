"""Changes to the meaning of a file of a result: it can be read, and is not what its command wrote."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from hypothesis import strategies as st

from bayes_tyre.formats.netcdf import read_tree, write_tree

#: What may stand in the place of any value in JSON, and of any cell.
VALUES = [None, [], {}, "", "x", -1, 0, 1e300, True, "a\nb", "<b>", ["x"], {"x": 1}, [None], "\u202e", float("nan")]
CELLS = ["", "nan", "inf", "x", "-1", "0", "1e400", "a\nb", "'=1", "\u202e", "5 %", "1,5", "true"]
_NUMBERS = (np.nan, np.inf, -1.0, 0.0, 1e300, 1e-300)


def _variable(draw: st.DrawFn, data: xr.Dataset) -> str:
    return draw(st.sampled_from(sorted(map(str, data.variables))))


def _dropped(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    return data.drop_vars(_variable(draw, data))


def _filled(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    name = _variable(draw, data)
    filled = xr.full_like(data[name], draw(st.sampled_from(_NUMBERS)), dtype=float)
    return data.assign({name: filled}) if name in data.data_vars else data.assign_coords({name: filled})


def _one_filled(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    name = draw(st.sampled_from(sorted(map(str, data.data_vars))))
    values = data[name].to_numpy().astype(float)
    values.reshape(-1)[draw(st.integers(0, max(0, values.size - 1)))] = draw(st.sampled_from(_NUMBERS))
    return data.assign({name: (data[name].dims, values)})


def _texts(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    name = _variable(draw, data)
    texts = (data[name].dims, np.full(data[name].shape, draw(st.sampled_from(["", "x", "<b>", "single (0)20-30"]))))
    return data.assign({name: texts}) if name in data.data_vars else data.assign_coords({name: texts})


def _shorter(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    dim = draw(st.sampled_from(sorted(map(str, data.sizes))))
    return data.isel({dim: slice(draw(st.integers(0, 3)))})


def _transposed(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    del draw
    return data.transpose(*reversed(list(data.sizes)))


def _renamed(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    name, other = _variable(draw, data), draw(st.sampled_from(["k", "k_case", "x_case", "m_case", "energy", "other"]))
    return data if other in data.variables else data.rename({name: other})


def _single(draw: st.DrawFn, data: xr.Dataset) -> xr.Dataset:
    name = draw(st.sampled_from(sorted(map(str, data.data_vars))))
    return data.assign({name: data[name].reset_coords(drop=True).isel(dict.fromkeys(data[name].dims, 0))})


_OF_GROUPS: tuple[Callable[[st.DrawFn, xr.Dataset], xr.Dataset], ...] = (
    *(_dropped, _filled, _one_filled, _texts, _shorter, _transposed, _renamed, _single),
)


def changed_tree(draw: st.DrawFn, path: Path) -> None:
    """Change a posterior: a group, a variable, a dimension, or what its attributes say."""
    tree = read_tree(path)
    name = draw(st.sampled_from(["posterior", "posterior", *sorted(tree.children)]))
    way = draw(st.integers(0, 5))
    if way == 0:
        del tree[name]
    elif way == 1:
        attribute = draw(st.sampled_from(sorted(map(str, tree.attrs)) or ["law"]))
        tree.attrs[attribute] = draw(st.sampled_from(["", "x", 3, -1.0, "records", "fancher", "[]"]))
    elif way == 2:
        tree.attrs = {}
    else:
        group = tree[name].to_dataset()
        tree[name] = xr.DataTree(draw(st.sampled_from(_OF_GROUPS))(draw, group) if group.data_vars else group)
    write_tree(tree, path)


def changed_table(draw: st.DrawFn, path: Path) -> None:
    """Change a table: a column, a row, a cell or all cells of a column."""
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"))))
    column, row = draw(st.integers(0, len(rows[0]) - 1)), draw(st.integers(0, len(rows) - 1))
    way = draw(st.integers(0, 5))
    if way == 0:
        rows = [[*each[:column], *each[column + 1 :]] for each in rows]
    elif way == 1:
        rows = rows[: draw(st.integers(1, len(rows)))]
    elif way == 2:
        rows = [*rows, *rows[1:]]
    elif way == 3:
        cell = draw(st.sampled_from(CELLS))
        rows = [rows[0], *([*each[:column], cell, *each[column + 1 :]] for each in rows[1:])]
    elif way == 4:
        del rows[row]
    else:
        rows[row][column] = draw(st.sampled_from([*CELLS, *rows[0]]))
    written = io.StringIO()
    csv.writer(written, lineterminator="\n").writerows(rows)
    path.write_text(written.getvalue(), encoding="utf-8")


def changed_json(draw: st.DrawFn, path: Path) -> None:
    """Change a JSON file: what stands under a key, at any depth, or that it is there."""
    content = json.loads(path.read_text(encoding="utf-8"))
    place = content
    while keys := sorted(place) if isinstance(place, dict) else [*range(len(place))]:
        key = draw(st.sampled_from(keys))
        if isinstance(place[key], dict | list) and place[key] and draw(st.booleans()):
            place = place[key]
            continue
        _replace(draw, place, key)
        break
    path.write_text(json.dumps(content), encoding="utf-8")


def _replace(draw: st.DrawFn, place: Any, key: Any) -> None:
    if draw(st.booleans()):
        place[key] = draw(st.sampled_from(VALUES))
    else:
        del place[key]


#: By suffix, what changes the meaning of a file.
MEANING: dict[str, Callable[[st.DrawFn, Path], None]] = {
    ".nc": changed_tree,
    ".csv": changed_table,
    ".json": changed_json,
}
