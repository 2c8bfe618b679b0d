"""Batches of records: records of different lengths padded to arrays of one shape."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

#: Least width of a batch; shorter records are padded to it.
NARROWEST = 32


@dataclass(frozen=True)
class Batch:
    """Records of different lengths in one array, padded after their last point.

    Attributes
    ----------
    records:
        Names, in the order of the rows.
    displacement_mm, force_kN:
        Shape (records, points), float64; padding repeats the record's first point.
    present:
        Shape (records, points); False on padding.
    force_error_kN:
        Shape (records, points): what an error of one standard deviation that the points of a record share does to their
        forces, 0 on padding; None: there is none that is known.
    """

    records: tuple[str, ...]
    displacement_mm: Float[np.ndarray, "records points"]
    force_kN: Float[np.ndarray, "records points"]
    present: Bool[np.ndarray, "records points"]
    force_error_kN: Float[np.ndarray, "records points"] | None = None

    @property
    def points(self) -> np.ndarray:
        """Number of measured points a record, shape (records,)."""
        return self.present.sum(axis=1)

    @property
    def digest(self) -> str:
        """SHA-256 of the records' names and readings, whatever the order of the records."""
        digest = hashlib.sha256()
        for i in np.argsort(self.records):
            digest.update(self.records[i].encode())
            for readings in (self.displacement_mm, self.force_kN):
                digest.update(np.ascontiguousarray(readings[i][self.present[i]]).tobytes())
        return digest.hexdigest()

    def narrowed(self, width: int) -> "Batch":
        """Return the first `width` points of every record."""
        fields = (self.displacement_mm, self.force_kN, self.present)
        displacement, force, present = (np.ascontiguousarray(field[:, :width]) for field in fields)
        error = None if self.force_error_kN is None else self.force_error_kN[:, :width]
        return Batch(self.records, displacement, force, present, error)

    def only(self, mask: Bool[np.ndarray, " records"]) -> "Batch":
        """Return some of the records, as wide as all."""
        names = tuple(name for name, chosen in zip(self.records, mask, strict=True) if chosen)
        error = None if self.force_error_kN is None else self.force_error_kN[mask]
        return Batch(names, self.displacement_mm[mask], self.force_kN[mask], self.present[mask], error)


def batches(table: pd.DataFrame, cells: int = 131_072) -> Iterator[Batch]:
    """Yield the records of a checked table in batches of similar length, so that memory stays bounded.

    Parameters
    ----------
    table:
        A checked record table.
    cells:
        Most padded points in a batch (a longer record is a batch of its own). Lengths are padded to the
        next power of two (at least 32): the number of shapes, and so of compilations, grows with the logarithm
        of the longest record.
    """
    codes, names = pd.factorize(table["record"])
    order = _order(codes)
    lengths = np.bincount(codes)
    first = np.cumsum(lengths) - lengths
    displacement = table["displacement_mm"].to_numpy(dtype=float)
    force = table["force_kN"].to_numpy(dtype=float)
    widths = np.maximum(NARROWEST, 2 ** np.ceil(np.log2(lengths)).astype(int))
    for width in np.unique(widths):
        members = np.flatnonzero(widths == width)
        size = max(1, cells // width)
        column = np.arange(width)
        for block in (members[start : start + size] for start in range(0, len(members), size)):
            present = column < lengths[block][:, None]
            rows = first[block][:, None] + np.where(present, column, 0)
            rows = rows if order is None else order[rows]
            yield Batch(tuple(map(str, names[block])), displacement[rows], force[rows], present)


def _order(codes: Int[np.ndarray, " rows"]) -> Int[np.ndarray, " rows"] | None:
    """Return the row order that puts records one after another; None where they already are."""
    return None if (np.diff(codes) >= 0).all() else np.argsort(codes, kind="stable")


def pad(records: tuple[str, ...], displacement: list[np.ndarray], force: list[np.ndarray]) -> Batch:
    """Return the records (mm, kN; one array each) as a batch as wide as the longest."""
    shape = (len(records), max(len(d) for d in displacement))
    present = np.zeros(shape, dtype=bool)
    padded_d, padded_f = np.empty(shape), np.empty(shape)
    for i, (d, f) in enumerate(zip(displacement, force, strict=True)):
        present[i, : len(d)] = True
        padded_d[i], padded_f[i] = d[0], f[0]
        padded_d[i, : len(d)], padded_f[i, : len(d)] = d, f
    return Batch(records, padded_d, padded_f, present)
