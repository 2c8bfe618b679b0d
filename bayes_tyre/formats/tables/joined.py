"""One table out of many parts on disk: a part at a time is in memory, however many there are."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from bayes_tyre.formats.files import whole_file
from bayes_tyre.formats.tables.formulas import harmless, map_texts
from bayes_tyre.formats.tables.table_files import quoting_of

Change = Callable[[pd.DataFrame], pd.DataFrame]
# Rows of a row group at least, so that a part a few hundred rows long is none of its own; some 20 MB.
_GROUP = 1 << 17


def write_part(table: pd.DataFrame, path: Path) -> Path:
    """Write a part (Parquet, whatever its name), whole or not at all; return its path."""
    with whole_file(path) as beside:
        table.to_parquet(beside, index=False)
    return path


def is_part(path: Path) -> bool:
    """Return whether a whole part is there."""
    try:
        pq.read_schema(path)
    except (OSError, pa.ArrowInvalid):
        return False
    return True


def write_joined(parts: Sequence[Path], path: Path, changes: Sequence[Change | None] | None = None) -> Path:
    """Write one or more parts under one another, as `.csv` or `.parquet`, as `write_table` would; return the path.

    Columns are those of all parts; cells that a part has not are missing. `changes`, one a part, are what is done to
    its table before it is written; None: nothing.
    """
    schemas = [pq.read_schema(part) for part in parts]
    schema = pa.unify_schemas(schemas, promote_options="permissive").with_metadata(schemas[0].metadata)
    each = zip(parts, changes or [None] * len(parts), strict=True)
    tables = (_read(part, schema, change) for part, change in each)
    with whole_file(path) as beside:
        if path.suffix.lower() == ".parquet":
            _join_parquet(tables, schema, beside)
        else:
            _join_csv(tables, beside)
    return path


def _join_parquet(tables: Iterable[pa.Table], schema: pa.Schema, path: Path) -> None:
    with pq.ParquetWriter(path, schema) as writer:
        waiting: list[pa.Table] = []
        for table in tables:
            waiting.append(table)
            if sum(table.num_rows for table in waiting) >= _GROUP:
                writer.write_table(pa.concat_tables(waiting))
                waiting.clear()
        if waiting:
            writer.write_table(pa.concat_tables(waiting))


def _join_csv(tables: Iterable[pa.Table], path: Path) -> None:
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
        for i, part in enumerate(tables):
            table = map_texts(part.to_pandas(), harmless)
            table.to_csv(file, index=False, header=not i, lineterminator="\n", quoting=quoting_of(table))


def _read(part: Path, schema: pa.Schema, change: Change | None) -> pa.Table:
    table = pq.read_table(part)
    if change is not None:
        table = pa.Table.from_pandas(change(table.to_pandas()), schema=table.schema, preserve_index=False)
    missing = [name for name in schema.names if name not in table.column_names]
    for name in missing:
        table = table.append_column(name, pa.nulls(table.num_rows, schema.field(name).type))
    return table.select(schema.names).cast(schema)
