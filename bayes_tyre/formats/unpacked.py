"""What a file would do to the library that reads it, found before: unpack to any size, end the process, never end."""

import io
import mmap
import struct
import zlib
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bayes_tyre.errors import BadInput

#: A file is refused that unpacks to more bytes than this and to more than so many times its own size: recordings and
#: draws pack to a tenth at best, numbers that repeat to a thousandth.
MOST_BYTES, MOST_TIMES = 1 << 27, 100
_PIECE = 1 << 16
#: Of MATLAB files: bytes of the header, and types of data.
_MAT_HEADER, _VARIABLE, _COMPRESSED = 128, 14, 15
_MAT_KINDS = {*range(1, 8), 9, *range(12, 19)}
#: How a global heap of HDF5 begins: its name and version.
_HEAP = b"GCOL\x01\0\0\0"


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
    """Refuse an HDF5 file (netCDF, MATLAB 7.3) whose arrays are too large (`check_unpacked`), or damaged.

    HDF5 2.0 never ends where free space among texts and references has no length.

    Raises
    ------
    BadInput
        With the size and the limit.
    OSError
        If it is damaged, as h5py does.
    """
    import h5py  # slow to import, and text tables have no use for it

    _check_heaps(path)
    size = 0

    def add(_: str, item: object) -> None:
        nonlocal size
        size += item.nbytes if isinstance(item, h5py.Dataset) else 0

    with h5py.File(path, "r") as file:
        file.visititems(add)
    check_unpacked(path, int(size))


def _check_heaps(path: Path) -> None:
    """Walk the global heaps of an HDF5 file as HDF5 does: a header of 16 bytes each, then objects one after another."""
    if path.stat().st_size == 0:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        heap = -1
        while (heap := content.find(_HEAP, heap + 1)) >= 0:
            end = heap + int.from_bytes(content[heap + 8 : heap + 16], "little")
            at = heap + 16
            while at + 16 <= min(end, len(content)):
                number, length = struct.unpack("<H6xQ", content[at : at + 16])
                if number == length == 0:
                    raise OSError(f"free space at byte {at} has no length: the file is damaged")
                at += 16 + length + -length % 8 if number else length


def check_mat_5(path: Path) -> None:
    """Refuse a MATLAB file of version 5 whose compressed variables are too large (`check_unpacked`), or damaged.

    SciPy ends the process where it meets a type of data that it does not know.

    Raises
    ------
    BadInput
        With the size and the limit, or the unknown type.
    """
    with path.open("rb") as file:
        header = file.read(_MAT_HEADER)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:])
        if order is not None and 0 not in header[:4]:  # else it is of version 4, where nothing is compressed
            _check_elements(path, file, order, 0)


def _check_elements(path: Path, stream: io.BufferedIOBase, order: str, size: int) -> int:
    """Check the elements of a stream one after another; those of a variable follow its tag. Return the bytes so far."""
    while len(tag := stream.read(8)) == 8:
        kind, length = struct.unpack(f"{order}II", tag)
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, length = kind & 0xFFFF, 0
        if kind not in _MAT_KINDS:
            raise BadInput(f"{path}: holds data of type {kind}, which MATLAB does not have: damaged; save it again")
        if kind == _COMPRESSED:
            content = _unpacked(path, stream, length, size)
            size = _check_elements(path, io.BytesIO(content), order, size + len(content))
        elif kind != _VARIABLE:
            stream.seek(length + -length % 8, 1)
    return size


def _unpacked(path: Path, stream: io.BufferedIOBase, left: int, size: int) -> bytearray:
    """Return a compressed variable's content, or refuse it once it is too large beside the `size` before it."""
    unpack, content, most = zlib.decompressobj(), bytearray(), limit_of(path)
    while left > 0 and (piece := stream.read(min(left, _PIECE))):
        left -= len(piece)
        while piece and size + len(content) <= most:
            content += unpack.decompress(piece, _PIECE)
            piece = unpack.unconsumed_tail
        check_unpacked(path, size + len(content))
    return content


#: What a column of text may be; pandas writes large strings.
_TEXTS = (pa.types.is_string, pa.types.is_large_string)


def check_parquet(path: Path) -> None:
    """Refuse a Parquet file whose table is too large; see `check_unpacked`."""
    described = pq.read_metadata(path)
    groups = [described.row_group(i).total_byte_size for i in range(described.num_row_groups)]
    check_unpacked(path, max(sum(groups), 8 * described.num_rows * described.num_columns))
    texts = [field.name for field in pq.read_schema(path) if any(of(field.type) for of in _TEXTS)]
    if texts:  # each text once, and where it stands
        coded = pq.read_table(path, columns=texts, read_dictionary=texts)
        check_unpacked(path, sum(map(_length_of_texts, coded.columns)))


def _length_of_texts(column: pa.ChunkedArray) -> int:
    size = 0
    for one in column.chunks:
        lengths = pc.call_function("binary_length", [one.dictionary])
        size += pc.call_function("sum", [lengths.take(one.indices)]).as_py() or 0
    return size
