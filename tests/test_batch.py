"""Batches: every record once, with its own points."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st

from bayes_tyre.batch import batches, pad


def table_of(lengths: list[int], interleave: Callable[[int], np.ndarray]) -> pd.DataFrame:
    """Records of the given lengths; every point has a number of its own."""
    names = np.repeat([f"r{i}" for i in range(len(lengths))], lengths)[interleave(sum(lengths))]
    number = np.arange(len(names), dtype=float)
    return pd.DataFrame({"record": names, "displacement_mm": number, "force_kN": -1.0 - number})


def expect_each_record_once(table: pd.DataFrame, cells: int) -> None:
    found: dict[str, np.ndarray] = {}
    for batch in batches(table, cells):
        rows, width = batch.present.shape
        assert rows == len(batch.records) == len(batch.points)
        assert rows == 1 or rows * width <= cells
        assert width >= 32
        assert width & (width - 1) == 0  # a power of two
        assert batch.displacement_mm.shape == batch.force_kN.shape == (rows, width)
        for i, record in enumerate(batch.records):
            assert record not in found
            found[record] = batch.displacement_mm[i, batch.present[i]]
            np.testing.assert_array_equal(batch.force_kN[i], -1.0 - batch.displacement_mm[i])
            padding = batch.displacement_mm[i, ~batch.present[i]]
            assert batch.points[i] == np.argmin([*batch.present[i], False])  # all of the padding is behind
            np.testing.assert_array_equal(padding, found[record][0])
    assert set(found) == set(table["record"])
    for record, points in table.groupby("record")["displacement_mm"]:
        np.testing.assert_array_equal(found[str(record)], points)


@settings(max_examples=60)
@given(
    lengths=st.lists(st.integers(1, 140), min_size=1, max_size=12),
    cells=st.sampled_from([1, 64, 256, 131_072]),
    seed=st.none() | st.integers(0, 99),
)
def test_batches_hold_every_record_once_with_its_own_points(lengths, cells, seed):
    order = np.arange if seed is None else np.random.default_rng(seed).permutation
    expect_each_record_once(table_of(lengths, order), cells)


def test_interleaved_records_are_told_apart():
    expect_each_record_once(table_of([40, 40, 40], lambda n: np.arange(n).reshape(3, -1).T.ravel()), 131_072)


def test_like_lengths_share_a_shape():
    table = table_of([3, 32, 33, 64, 65, 20], np.arange)
    assert {batch.present.shape[1]: batch.records for batch in batches(table)} == {
        32: ("r0", "r1", "r5"),
        64: ("r2", "r3"),
        128: ("r4",),
    }


def test_pad_is_as_wide_as_the_longest():
    d = [np.array([1.0, 2.0]), np.array([3.0, 4.0, 5.0])]
    batch = pad(("a", "b"), d, [-d[0], -d[1]])
    assert batch.displacement_mm.tolist() == [[1.0, 2.0, 1.0], [3.0, 4.0, 5.0]]
    assert batch.force_kN.tolist() == [[-1.0, -2.0, -1.0], [-3.0, -4.0, -5.0]]
    assert batch.present.tolist() == [[True, True, False], [True, True, True]]
    assert batch.points.tolist() == [2, 3]


def test_a_narrowed_batch_keeps_its_first_points():
    batch = pad(("a", "b"), [np.arange(4.0), np.arange(2.0)], [np.ones(4), np.zeros(2)])
    narrow = batch.narrowed(3)
    assert narrow.records == batch.records
    np.testing.assert_array_equal(narrow.displacement_mm, batch.displacement_mm[:, :3])
    np.testing.assert_array_equal(narrow.force_kN, batch.force_kN[:, :3])
    assert narrow.points.tolist() == [3, 2]
