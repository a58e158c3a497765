"""A run that `quadlab log export` wrote as tables, as the same messages again.

A table's columns are the numbers and texts of a message by their paths. Messages of the same
structure (lengths of sequences, texts) are encoded once, and their numbers put into copies.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype

from extensions.importers.readers.mat import loaded
from extensions.importers.readers.progress import bounded_time
from extensions.importers.readers.tables import foreign_reader
from flight_log.payload_columns import schema_of
from flight_log.payload_layout import HEADER_STAMP, MAX_ITEMS, SchemaLayouts
from flight_log.writer import Batch, LogWriter
from quadrotor.errors import LogFormatError, os_errors
from quadrotor.records import Stamps
from vehicle_link.messages import encode, header, new, stored_name, time_message, typestore
from vehicle_link.topics.table import TOPICS

TIME, STAMP, RECEIVED = "time", "stamp_ns", "received_ns"
CSV_HEAD = b'"time [s]","stamp_ns [ns]","received_ns [ns]"'
MAT_HEAD = b"MATLAB 5.0 MAT-file"
RUN, TYPE = b"quadlab.run", b"quadlab.type"
SECOND_NS = 1_000_000_000
SLICE_NS = 10 * SECOND_NS
"""Duration of what is encoded at once."""
Column = npt.NDArray[Any]


class TopicTable(NamedTuple):
    """One topic of an exported run."""

    topic: str  # without the vehicle's namespace
    type_name: str
    columns: dict[str, Column]  # (N,) by path; texts as objects
    run: Mapping[str, str]


def is_exported(path: Path) -> bool:
    """Return whether a file or folder was written by `quadlab log export`."""
    if path.is_dir():
        return bool(_tables_in(path))
    return path.is_file() and _begins(path, MAT_HEAD) and _is_run_of_mat(path)


def read_exported(path: Path) -> tuple[list[TopicTable], list[str]]:
    """Return the topics of an exported run, and notes on those that are left out.

    Raises LogFormatError or StorageError.
    """
    found, notes = [], []
    with bounded_time([path]), os_errors(lambda why: f"cannot read {path}: {why}"):
        for one in _of_mat(path) if path.is_file() else map(_of_file, _tables_in(path)):
            if stored_name(one.type_name or "/") not in typestore().types:
                notes.append(f"{one.topic} is left out: the type of its messages is not known")
            elif not {STAMP, RECEIVED} <= one.columns.keys():
                raise LogFormatError(f"{path.name}, {one.topic}: {STAMP} and {RECEIVED} are needed")
            else:
                found.append(one)
    if not found:
        raise LogFormatError(f"{path.name} has no topic of quadlab; {'; '.join(notes)}")
    return found, notes


def write_exported(
    log: Path, tables: list[TopicTable], vehicle: str, run: Mapping[str, str]
) -> None:
    """Write a new log of these topics. Raises LogFormatError or StorageError."""
    first = min(int(one.columns[RECEIVED].min()) for one in tables)
    last = max(int(one.columns[RECEIVED].max()) for one in tables)
    with LogWriter(log, run, {}, chunk_age_ns=SECOND_NS) as writer:
        for begin in range(first, last + 1, SLICE_NS):
            batches = [
                batch for one in tables for batch in _batches(one, vehicle, begin, begin + SLICE_NS)
            ]
            if batches:
                writer.write_batches(batches)


def _begins(path: Path, head: bytes) -> bool:
    with os_errors(lambda why: f"cannot read {path}: {why}"), path.open("rb") as file:
        return file.read(len(head)) == head


def _is_run_of_mat(path: Path) -> bool:
    """Return whether a .mat file begins with the structure `run`, or cannot be read."""
    from scipy.io import whosmat

    try:
        names = whosmat(path)
    except Exception:  # `read_exported` says what is wrong with it
        return True
    return bool(names) and names[0][0] == "run" and {kind for *_, kind in names} == {"struct"}


def _is_run_of_parquet(path: Path) -> bool:
    from pyarrow import ArrowException, parquet

    try:
        with path.open("rb") as file:  # a name that is no UTF-8 is not opened by Arrow
            return RUN in (parquet.read_schema(file).metadata or {})
    except ArrowException:  # `read_exported` says what is wrong with it
        return True


def _tables_in(folder: Path) -> list[Path]:
    found = [one for one in sorted(folder.glob("*.parquet")) if _is_run_of_parquet(one)]
    return found or [one for one in sorted(folder.glob("*.csv")) if _begins(one, CSV_HEAD)]


def _type_of(topic: str) -> str:
    """Return the type of a topic of quadlab; empty for others, and where two have such a name."""
    names = [topic, f"/{topic}"]
    return next((TOPICS[one].type_name for one in names if one in TOPICS), "")


def _of_file(path: Path) -> TopicTable:
    """Read a table. Raises LogFormatError."""
    from pyarrow import csv, parquet

    told: Mapping[bytes, bytes] = {}
    with foreign_reader(path, "table"), path.open("rb") as file:
        if path.suffix == ".parquet":
            table = parquet.read_table(file)
            told = table.schema.metadata or {}
        else:
            options = csv.ConvertOptions(column_types=_kinds_of(path))
            table = csv.read_csv(file, convert_options=options)
            names = [re.sub(r" \[[^\]]*\]$", "", one) for one in table.column_names]
            table = table.rename_columns(names)
    columns = {one: table[one].to_numpy() for one in table.column_names}
    type_name = told.get(TYPE, b"").decode() or _type_of(path.stem)
    return TopicTable(path.stem, type_name, columns, json.loads(told.get(RUN, b"{}")))


def _kinds_of(path: Path) -> dict[str, object]:
    """Return the types of a CSV file's columns. Texts are told by the type of its messages; a
    number is not always an integer, only because those in the file are.
    """
    import pyarrow as pa

    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().strip('"').split('","')
    type_name = _type_of(path.stem)
    kinds = {one: pa.float64() for one in names}
    kinds |= dict.fromkeys((f"{STAMP} [ns]", f"{RECEIVED} [ns]"), pa.int64())
    texts = [one for one in names if not type_name or _is_text(type_name, one)]
    return kinds | dict.fromkeys(texts, pa.string())


def _is_text(type_name: str, path: str) -> bool:
    """Return whether a path of a message is that of a text, or of several."""
    name: Any = stored_name(type_name)
    for part in re.sub(r" ?\[[^\]]*\]", "", path).split("."):
        kind: Any
        details: Any
        kind, details = dict(typestore().fielddefs[name][1]).get(part, (None, None))
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            kind, details = details[0]
        if kind is None or kind == Nodetype.BASE:
            return kind is not None and details[0] in ("string", "wstring")
        name = details
    return False


def _of_mat(path: Path) -> Iterator[TopicTable]:
    """Yield the topics of a .mat file. Raises LogFormatError."""
    every = loaded(path).items()
    content = {k: one for k, one in every if isinstance(one, np.ndarray) and one.dtype.names}
    run = _of_struct(content.pop("run")) if "run" in content else {}
    for topic, found in content.items():
        fields = _of_struct(found)
        paths = fields.get("paths", {})
        columns = {paths[one]: values for one, values in fields.items() if one in paths}
        type_name = str(fields.get("type", "")) or _type_of(topic)
        yield TopicTable(topic, type_name, columns, run)


def _of_struct(found: npt.NDArray[Any]) -> dict[str, Any]:
    """Return the fields of a MATLAB struct: structs as dictionaries, cells of texts as objects."""
    fields: dict[str, Any] = {}
    for name in found.dtype.names or ():
        value = found[name].ravel()[0]
        if value.dtype.names:
            fields[name] = _of_struct(value)
        elif value.dtype.kind == "U":
            fields[name] = "".join(value.ravel())
        elif value.dtype == object:
            fields[name] = np.array(["".join(one.ravel()) for one in value.ravel()], object)
        else:
            fields[name] = value.ravel()
    return fields


def _batches(table: TopicTable, vehicle: str, begin: int, end: int) -> Iterator[Batch]:
    """Yield the messages received from `begin` to before `end`, ns."""
    received = table.columns[RECEIVED]
    rows = np.flatnonzero((received >= begin) & (received < end))
    columns = {name: values[rows] for name, values in table.columns.items()}
    for kept in _alike(columns):
        group = {name: values[kept] for name, values in columns.items()}
        payloads = _payloads(table.type_name, group)
        log_ns, stamps = group[RECEIVED].astype(np.int64), group[STAMP].astype(np.int64)
        topic = f"/{table.topic}" if f"/{table.topic}" in TOPICS else f"/{vehicle}/{table.topic}"
        yield Batch(topic, table.type_name, payloads, log_ns, stamps)


def _alike(columns: Mapping[str, Column]) -> Iterator[npt.NDArray[np.int64]]:
    """Yield the rows of each structure: the same texts, and the same items of sequences."""
    count = len(columns[RECEIVED])
    codes = np.zeros(count, np.int64)
    for name, values in columns.items():
        if values.dtype == object:
            code = np.unique(values.astype(str), return_inverse=True)[1]
        elif "[" in name and values.dtype.kind == "f":
            code = np.isnan(values).astype(np.int64)
        else:
            continue
        codes = np.unique(codes * (int(code.max(initial=0)) + 1) + code, return_inverse=True)[1]
    for one in range(int(codes.max(initial=-1)) + 1):
        yield np.flatnonzero(codes == one)


def _payloads(type_name: str, columns: Mapping[str, Column]) -> npt.NDArray[np.void]:
    """Return messages of one structure in CDR."""
    first = {name: values[0] for name, values in columns.items()}
    stamps: Stamps = columns[STAMP].astype(np.int64)
    made = encode(new(type_name, **_fields(stored_name(type_name), "", first)))
    layout = SchemaLayouts(schema_of(type_name), stamps=True).of(made)
    rows = np.tile(np.frombuffer(made, np.uint8), (len(stamps), 1))
    if layout.numbers:
        numbers = rows.view(layout.record)[:, 0]
        told = {**columns, **dict(zip(HEADER_STAMP, np.divmod(stamps, SECOND_NS), strict=True))}
        for path in layout.numbers:
            if path in told:
                numbers[path] = told[path]
    return rows.view(f"V{len(made)}")[:, 0]


def _fields(name: str, prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a message of this type from the values of its paths."""
    found: dict[str, Any] = {}
    for key, (kind, details) in typestore().fielddefs[name][1]:
        path = f"{prefix}{key}"
        if details == "std_msgs/msg/Header":
            found[key] = header(int(values[STAMP]))
        elif key == "stamp" and details == "builtin_interfaces/msg/Time":
            found[key] = time_message(int(values[STAMP]))
        elif kind == Nodetype.NAME:
            found[key] = _fields(str(details), f"{path}.", values)
        elif kind == Nodetype.BASE and details[0] == "string":
            found[key] = str(values.get(path, ""))
        elif kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            found[key] = _items(path, kind == Nodetype.ARRAY, details, values)
    return {key: value for key, value in found.items() if value is not None}


def _items(path: str, is_fixed: bool, details: Any, values: Mapping[str, Any]) -> Any:
    """Return the items of an array; None where the table has none of them."""
    (kind, item), length = details
    if kind == Nodetype.BASE and item[0] in ("string", "wstring"):
        return str(values[path]).split(", ") if values.get(path) else None
    count = length if is_fixed else _length(path, values)
    if kind == Nodetype.NAME:
        return [_fields(str(item), f"{path}[{k}].", values) for k in range(count)]
    return None if is_fixed else np.zeros(count)


def _length(path: str, values: Mapping[str, Any]) -> int:
    """Return how many items of a sequence a message has: those with a number or a text."""
    for k in range(MAX_ITEMS):
        start = f"{path}[{k}]"
        items = [value for one, value in values.items() if one.startswith(start)]
        if not any(isinstance(one, str) or not np.isnan(one) for one in items):
            return k
    return MAX_ITEMS
