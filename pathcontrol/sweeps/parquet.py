"""Tables of columns as Parquet files: what a chunk of a sweep is on disk."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._extras import load_extra
from pathcontrol.errors import InputError


def load_parquet() -> Any:
    """Return the module that reads and writes Parquet.

    Raises:
        MissingExtraError: it is not installed.
    """
    return load_extra("pyarrow.parquet", "sweep", "the table of a sweep")


def encode_table(columns: Mapping[str, Array]) -> memoryview:
    """Return the content of the file of a table with ``columns``, (k,) or (k, d) each."""
    import pyarrow as pa

    memory = io.BytesIO()
    load_parquet().write_table(pa.table({name: _column(values) for name, values in columns.items()}), memory)
    return memory.getbuffer()


def decode_table(content: bytes, names: list[str] | None, rows: int) -> dict[str, Array]:
    """Return the columns of a file, or those of the ``names`` that it has.

    Raises:
        InputError: it cannot be read, or has another number of ``rows``.
    """
    import pyarrow as pa

    try:
        with load_parquet().ParquetFile(pa.BufferReader(content)) as opened:
            if opened.metadata.num_rows != rows:
                raise InputError(f"it has {opened.metadata.num_rows} rows", value=opened.metadata.num_rows, limit=rows)
            there = opened.schema_arrow.names
            some = None if names is None else [name for name in names if name in there]
            # threads of the pool that are still at work when Python ends abort the process
            table = opened.read(columns=some, use_threads=False)
        return {name: _values(table.column(name)) for name in table.column_names}
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise InputError(str(error)) from error


def join_tables(chunks: list[dict[str, Array]]) -> dict[str, Array]:
    """Return the rows of all chunks in the order of their samples."""
    if not chunks:
        return {"sample": np.empty(0, dtype=np.int64)}
    every = dict.fromkeys(name for chunk in chunks for name in chunk)
    found = {name: np.concatenate([_fill_column(chunk, name, chunks) for chunk in chunks]) for name in every}
    _, order = np.unique(found["sample"], return_index=True)
    return {name: values[order] for name, values in found.items()}


def _fill_column(chunk: Mapping[str, Array], name: str, chunks: list[dict[str, Array]]) -> Array:
    """Return a column of a chunk, without values where only other chunks have it."""
    if name in chunk:
        return chunk[name]
    like = next(other[name] for other in chunks if name in other)
    return np.full((len(chunk["sample"]), *like.shape[1:]), "" if like.dtype.kind == "U" else np.nan)


def _column(values: Array) -> Any:
    """Return values as a column of Arrow."""
    import pyarrow as pa

    if values.ndim == 1:
        return pa.array(values.tolist() if values.dtype.kind in "UO" else values)
    flat = values.reshape(-1)
    return pa.FixedSizeListArray.from_arrays(
        pa.array(flat.tolist() if flat.dtype.kind in "UO" else flat), values.shape[1]
    )


def _values(column: Any) -> Array:
    """Return a column of Arrow as an array."""
    import pyarrow as pa

    combined = column.combine_chunks()
    if isinstance(combined, pa.ChunkedArray):
        combined = pa.concat_arrays(combined.chunks)
    if pa.types.is_fixed_size_list(combined.type):
        return _values(pa.chunked_array([combined.flatten()])).reshape(-1, combined.type.list_size)
    values = combined.to_numpy(zero_copy_only=False)
    return values.astype(str) if values.dtype == object else values
