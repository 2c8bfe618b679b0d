"""Parts joined on disk are the table that they would be in memory."""

import pandas as pd
import pytest

from bayes_tyre.formats.tables import joined
from bayes_tyre.formats.tables.joined import is_part, write_joined, write_part
from bayes_tyre.formats.tables.table_files import read_table, write_table

TABLES = [
    pd.DataFrame({"record": "=a", "repeat": 1, "force_kN": [0.1, 1 / 3, -0.0]}),
    pd.DataFrame({"record": 'b, "quoted"', "repeat": 2, "force_kN": [5e-324]}),
    pd.DataFrame({"record": "⌀", "repeat": 3, "force_kN": [1e23, float("nan")]}),
]


@pytest.mark.parametrize("rows", [1, 4, 1000])
def test_joined_parts_are_one_table(rows, monkeypatch, tmp_path):
    monkeypatch.setattr(joined, "_GROUP", rows)
    parts = [write_part(table, tmp_path / f"{i}.part") for i, table in enumerate(TABLES)]
    assert all(map(is_part, parts))
    whole = pd.concat(TABLES, ignore_index=True)
    written = write_joined(parts, tmp_path / "r.csv").read_bytes()
    assert written == write_table(whole, tmp_path / "w.csv").read_bytes()
    pd.testing.assert_frame_equal(read_table(write_joined(parts, tmp_path / "r.parquet")), whole)


def test_a_column_that_a_part_has_not_is_missing_in_its_rows(tmp_path):
    tables = [TABLES[0], TABLES[1].assign(mass_kg=200.0)]
    parts = [write_part(table, tmp_path / f"{i}.part") for i, table in enumerate(tables)]
    joined_table = read_table(write_joined(parts, tmp_path / "r.parquet"))
    pd.testing.assert_frame_equal(joined_table, pd.concat(tables, ignore_index=True))


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_each_part_is_changed_by_its_own_change(suffix, tmp_path):
    parts = [write_part(table, tmp_path / f"{i}.part") for i, table in enumerate(TABLES[:2])]
    changes = [lambda table, n=n: table.assign(force_kN=table["force_kN"] + n) for n in (1.0, 2.0)]
    changed = read_table(write_joined(parts, tmp_path / f"r.{suffix}", changes))
    assert changed["force_kN"].tolist() == [*(TABLES[0]["force_kN"] + 1.0), *(TABLES[1]["force_kN"] + 2.0)]
    assert set(changed) == set(TABLES[0])


def test_no_part_is_none(tmp_path):
    assert not is_part(tmp_path / "none.part")
    (tmp_path / "half.part").write_bytes(b"PAR1")
    assert not is_part(tmp_path / "half.part")
