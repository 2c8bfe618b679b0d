"""How large a compressed file is unpacked, found before it is: a few bytes can claim to hold any number."""

import struct
import zlib
from pathlib import Path

import h5py
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bayes_tyre.errors import BadInput

#: A file is refused that unpacks to more bytes than this and to more than so many times its own size: recordings and
#: draws pack to a tenth at best, numbers that repeat to a thousandth.
MOST_BYTES, MOST_TIMES = 1 << 28, 100
_PIECE = 1 << 16
_COMPRESSED, _MAT_HEADER = 15, 128


def check_unpacked(path: Path, size: int) -> None:
    """Refuse a file that unpacks to so many bytes, if that is too much for its own size.

    Raises
    ------
    BadInput
        With the size and the limit.
    """
    if size > limit_of(path):
        raise BadInput(
            f"{path}: unpacks to {size / 1e6:,.0f} MB or more, over {MOST_BYTES / 1e6:,.0f} MB and {MOST_TIMES} times "
            "its own size; save it again without what repeats, or cut it in pieces"
        )


def limit_of(path: Path) -> int:
    """Return the bytes that a file may unpack to."""
    return max(MOST_BYTES, MOST_TIMES * path.stat().st_size)


def check_hdf5(path: Path) -> None:
    """Refuse an HDF5 file (netCDF, MATLAB 7.3) whose arrays are too large; see `check_unpacked`."""
    size = 0

    def add(_: str, item: object) -> None:
        nonlocal size
        size += item.nbytes if isinstance(item, h5py.Dataset) else 0

    with h5py.File(path, "r") as file:
        file.visititems(add)
    check_unpacked(path, int(size))


def check_mat_5(path: Path) -> None:
    """Refuse a MATLAB file of version 5 whose compressed variables are too large; see `check_unpacked`."""
    size, most = 0, limit_of(path)
    with path.open("rb") as file:
        order = "<" if file.read(_MAT_HEADER)[126:] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            if kind != _COMPRESSED:
                file.seek(length, 1)
                continue
            unpack, left = zlib.decompressobj(), length
            while left > 0 and (piece := file.read(min(left, _PIECE))):
                left -= len(piece)
                while piece and size <= most:
                    size += len(unpack.decompress(piece, _PIECE))
                    piece = unpack.unconsumed_tail
                check_unpacked(path, size)


def check_parquet(path: Path) -> None:
    """Refuse a Parquet file whose table is too large; see `check_unpacked`."""
    described = pq.read_metadata(path)
    groups = [described.row_group(i).total_byte_size for i in range(described.num_row_groups)]
    check_unpacked(path, max(sum(groups), 8 * described.num_rows * described.num_columns))
    texts = [field.name for field in pq.read_schema(path) if pa.types.is_string(field.type)]
    if texts:  # each text once, and where it stands
        coded = pq.read_table(path, columns=texts, read_dictionary=texts)
        check_unpacked(path, sum(map(_length_of_texts, coded.columns)))


def _length_of_texts(column: pa.ChunkedArray) -> int:
    size = 0
    for one in column.chunks:
        lengths = pc.call_function("binary_length", [one.dictionary])
        size += pc.call_function("sum", [lengths.take(one.indices)]).as_py() or 0
    return size
