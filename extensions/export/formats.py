"""File formats of tables: a file per topic for CSV and Parquet, one for all topics for MATLAB.

Files are written under temporary names and renamed at the end, so that a file with its final name
is complete.
"""

from __future__ import annotations

import contextlib
import json
import re
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol

from console.log_tables import Piece
from quadrotor.errors import StorageError

MAT_NAME = 63
"""Maximum number of characters that MATLAB allows in a name."""
MAT_BYTES = 250_000_000
"""Largest size of the values in a .mat file, all topics together."""
COMPRESSED_BYTES = 20_000_000
"""Size of the largest topic that is compressed: compression needs three times its memory."""


class Format(Protocol):
    """The files of an export, which take pieces of tables."""

    def write(self, piece: Piece) -> None: ...

    def finish(self) -> list[Path]:
        """Complete the files and return them under their final names."""

    def discard(self) -> None:
        """Remove all written files."""


class ColumnFiles:
    """CSV or Parquet files, by pyarrow.

    They are written in a separate thread while the next rows are read. Units follow the names in
    CSV (`pose.pose.position.x [m]`) and are in the fields' metadata in Parquet, whose schema has
    the metadata of the run.
    """

    def __init__(self, folder: Path, kind: str, run: Mapping[str, str]) -> None:
        self._folder, self._kind, self._run = folder, kind, run
        self._writers: dict[str, Any] = {}
        self._types: dict[str, str] = {}
        self._files: list[Path] = []
        self._writing = ThreadPoolExecutor(1, "log export")
        self._last: Future[None] | None = None

    def write(self, piece: Piece) -> None:
        run = {"quadlab.run": json.dumps(dict(self._run)), "quadlab.type": piece.type_name}
        self._types[piece.topic] = piece.type_name
        table = _with_units_in_names(piece.table) if self._kind == "csv" else piece.table
        self._wait()  # so that no more than two tables are in memory
        self._last = self._writing.submit(
            self._put, piece.topic, table.replace_schema_metadata(run)
        )

    def finish(self) -> list[Path]:
        self._wait()
        self._writing.shutdown()
        for topic, writer in self._writers.items():
            writer.close()
            self._aside(topic).replace(self._path(topic))
            self._files.append(self._path(topic))
        return self._files

    def discard(self) -> None:
        self._writing.shutdown(cancel_futures=True)
        for writer in self._writers.values():
            with contextlib.suppress(OSError, ValueError):  # the full disk again
                writer.close()
        for topic in self._types:  # a topic that failed to open has a file but no writer
            self._aside(topic).unlink(missing_ok=True)
        for path in self._files:
            path.unlink(missing_ok=True)

    def _path(self, topic: str) -> Path:
        return self._folder / f"{topic}.{self._kind}"

    def _aside(self, topic: str) -> Path:
        return self._folder / f".{topic}.{self._kind}.new"

    def _put(self, topic: str, table: Any) -> None:
        if topic not in self._writers:
            self._writers[topic] = self._open(topic, table.schema)
        self._writers[topic].write_table(table)

    def _wait(self) -> None:
        """Wait for the present write and raise its exception."""
        last, self._last = self._last, None
        if last is not None:
            last.result()

    def _open(self, topic: str, schema: Any) -> Any:
        if self._kind == "parquet":
            from pyarrow.parquet import ParquetWriter

            return ParquetWriter(
                self._aside(topic), schema, compression="zstd", use_dictionary=False
            )
        from pyarrow.csv import CSVWriter

        return CSVWriter(self._aside(topic), schema)


def csv_files(folder: Path, stem: str, run: Mapping[str, str]) -> ColumnFiles:
    """Return CSV files, one a topic."""
    return ColumnFiles(folder, "csv", run)


def parquet_files(folder: Path, stem: str, run: Mapping[str, str]) -> ColumnFiles:
    """Return Parquet files, one a topic."""
    return ColumnFiles(folder, "parquet", run)


def _with_units_in_names(table: Any) -> Any:
    units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
    names = zip(table.column_names, units, strict=True)
    return table.rename_columns([f"{name} [{unit}]" if unit else name for name, unit in names])


class MatFile:
    """One .mat file of version 5: a struct per topic, and `run`.

    In it are the columns, structs with their `units` and their `paths` in the message, and `type`.

    The format needs each topic as a whole, so all rows are held in memory until the end.
    """

    def __init__(self, folder: Path, stem: str, run: Mapping[str, str]) -> None:
        self._path = folder / f"{stem}.mat"
        self._aside = folder / f".{stem}.mat.new"
        self._run = run
        self._pieces: dict[str, list[Piece]] = {}
        self._size = 0

    def write(self, piece: Piece) -> None:
        """Write a piece. Raises StorageError when the total does not fit into a file."""
        self._pieces.setdefault(piece.topic, []).append(piece)
        self._size += sum(map(_held, piece.table.columns))
        if self._size > MAT_BYTES:
            raise StorageError(
                f"up to {100 * piece.share:.0f} % of the log are more than {MAT_BYTES // 10**6} MB "
                "of values, the most a .mat file is made of; choose topics with --topics, a time "
                "with --from and --to, or parquet, which holds any length"
            )

    def finish(self) -> list[Path]:
        from scipy.io import savemat

        run = {_mat_name(name): text for name, text in self._run.items()}
        with self._aside.open("wb") as file:
            savemat(file, {"run": run}, long_field_names=True)
            for topic in list(self._pieces):
                table, size = _table(self._pieces.pop(topic))
                savemat(
                    file,
                    {_mat_name(topic): table},
                    do_compression=size < COMPRESSED_BYTES,
                    long_field_names=True,
                    oned_as="column",
                )
        self._aside.replace(self._path)
        return [self._path]

    def discard(self) -> None:
        self._aside.unlink(missing_ok=True)


def _table(pieces: list[Piece]) -> tuple[dict[str, Any], int]:
    """Return a topic's struct, and the size of its columns in bytes."""
    import pyarrow as pa

    table = pa.concat_tables([piece.table for piece in pieces])
    names = _mat_names(table.column_names)
    columns = {short: table[name].to_numpy() for name, short in names.items()}
    size = sum(one.nbytes for one in columns.values())
    fields = [(names[field.name], field.metadata or {}) for field in table.schema]
    units = {short: known.get(b"unit", b"").decode() for short, known in fields}
    paths = {short: name for name, short in names.items()}
    told = {"units": units, "paths": paths, "type": pieces[0].type_name}
    return {**columns, **told}, size


def _held(column: Any) -> int:
    """Return the size of a column in numpy, bytes; for texts, the pointers and each text once."""
    texts = column.unique().to_pylist() if str(column.type) == "string" else ()
    return 8 * len(column) + sum(map(sys.getsizeof, texts))


def _mat_names(columns: Iterable[str]) -> dict[str, str]:
    """Return distinct names that MATLAB allows."""
    names: dict[str, str] = {}
    for name in columns:
        short, number = _mat_name(name), 2
        while short in names.values():
            short, number = f"{_mat_name(name)[: MAT_NAME - 4]}_{number}", number + 1
        names[name] = short
    return names


def _mat_name(name: str) -> str:
    """Return the name for MATLAB (`bearings[2].x` → `bearings_2_x`); a long path is cut at its
    beginning.
    """
    plain = re.sub(r"\W+", "_", name).strip("_")
    return plain[-MAT_NAME:].lstrip("_0123456789") or "x"
