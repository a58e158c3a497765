"""Import of a recorded flight of another system as a run."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from extensions.importers.checks import checked_flight
from extensions.importers.exported import RECEIVED, TopicTable, write_exported
from extensions.importers.files import Files
from extensions.importers.flight import ImportedFlight
from extensions.importers.mapping import Mapping, load_mapping, names
from extensions.importers.raw import read_raw
from extensions.importers.readers.formats import format_of
from extensions.importers.readers.progress import bounded_time, told
from extensions.importers.run_writer import write_run
from extensions.importers.working_folder import working_folder
from flight_log.run_folder import STATION
from quadrotor.errors import LogFormatError, UsageError, os_errors

DEFAULT_VEHICLE = "imported"
DEFAULTS = {"mcap": "rosbag", "dataflash": "ardupilot", "tlog": "mavlink"}
"""Mappings of formats that have none of their own name."""
SOURCE = "import_source"
"""The entry of a run's metadata by which a repeated import knows it."""
EXAMPLE = "--mapping NAME_OR_FILE"
UNFINISHED = ".import-"
"""Prefix of the folders of the data folder in which runs are made."""
READ = 0.6
"""Share of an import after which the file is read, and not checked yet."""


def read_flight(
    path: Path,
    mapping: str | None = None,
    *,
    more: Sequence[Path] = (),
    truth: Path | None = None,
    table: str | None = None,
    stamps: str | None = None,
    flight: int | None = None,
    torn: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> ImportedFlight:
    """Read and check a recorded flight.

    Args:
        mapping: name or file; None: the format's default.
        more: further files of the same flight, of the same format.
        truth: the file of its [truth], instead of the one that the mapping names.
        table: the table of its [imu], and of sections with the same table, instead of the
            mapping's.
        stamps: one of STAMPS, the time of all topics of ROS instead of the mapping's.
        flight: which flight of a file with several is read, from 1.
        torn: whether a truncated file is read up to its end.
        progress: called with the share done, 0…1.

    Raises LogFormatError, StorageError or UsageError with what was found and what to try.
    """
    kind, found, chosen = _chosen(path, mapping, more, table, stamps)
    if truth is not None:
        found = _with_truth(found, truth, chosen)
    if flight is not None:
        found, flight = _of_flight(path, found, flight)
    with told(lambda share: progress(READ * share)), bounded_time([path, *more]):
        raw = read_raw([path, *more], found, torn=torn, flight=flight)
    progress(READ)
    vehicle = re.sub(r"[^a-z0-9_]", "_", found.vehicle.lower()) or DEFAULT_VEHICLE
    modified_ns = path.stat().st_mtime_ns
    named = f"{kind}, mapping {Path(chosen).name}" + (f", stamps {stamps}" if stamps else "")
    read = checked_flight(raw, vehicle, named, modified_ns)
    read.parameters = found.parameters
    progress(1.0)
    return read


def flights_of(
    path: Path,
    mapping: str | None = None,
    *,
    table: str | None = None,
    stamps: str | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> int:
    """Return how many flights a file has. Raises as `read_flight`."""
    _, found, _ = _chosen(path, mapping, (), table, stamps)
    reading = Files([path], found, torn=True, flight=1)
    with told(progress), bounded_time([path]), reading as files:
        if tables := files.source(found.imu).flights:
            return len(tables)
        files.read(found.imu, "imu", {"specific_force": (found.imu.specific_force, 3)})
        return files.flights.count


def _chosen(
    path: Path, mapping: str | None, more: Sequence[Path], table: str | None, stamps: str | None
) -> tuple[str, Mapping, str]:
    """Return the format of the files, their mapping and its name. Raises as `read_flight`."""
    kind = format_of(path)
    for one in more:
        if (other := format_of(one)) != kind:
            raise UsageError(
                f"{shown(path)} is {kind} and {shown(one)} is {other}: the files of one flight "
                "have one format"
            )
    if mapping is None:
        mapping = DEFAULTS.get(kind, kind)
        if mapping not in names():
            raise UsageError(
                f"{path.name} is {kind}, whose columns can be anything: say with {EXAMPLE} which "
                f"are what, or let --propose MAPPING.toml propose a mapping to you; there are "
                f"{', '.join(names())} (docs/importing.md)"
            )
    found = load_mapping(mapping)
    found = found if stamps is None else found.with_stamps(stamps)
    return kind, found if table is None else found.with_table(table), mapping


def _of_flight(path: Path, mapping: Mapping, flight: int) -> tuple[Mapping, int | None]:
    """Return the mapping, and the number of the flight where stamps tell; None where tables do.

    Raises as `read_flight`.
    """
    with Files([path], mapping, torn=True) as files:
        tables = files.source(mapping.imu).flights
    if not tables:
        return mapping, flight
    if not 1 <= flight <= len(tables):
        raise LogFormatError(f"{path.name} has no flight {flight}: there are {len(tables)}")
    return mapping.with_table(tables[flight - 1]), None


def shown(path: Path) -> str:
    """Return a file's name as one line; characters that a line cannot hold become a replacement
    character.
    """
    name = os.fsencode(path.name).decode(errors="replace")
    return "".join(one if one.isprintable() else "\ufffd" for one in name)


def source_named(path: Path, mapping: str | None, *choices: str | int | None) -> str:
    """Return the identity of a flight: names, sizes and dates of its files, and all choices.

    Raises StorageError.
    """
    files = [path, *([Path(mapping)] if mapping and Path(mapping).is_file() else [])]
    with os_errors(lambda why: f"cannot read {path}: {why}"):
        found = [(shown(one), one.stat().st_size, one.stat().st_mtime_ns) for one in files]
    return repr((*found, mapping, *choices))


def _with_truth(mapping: Mapping, truth: Path, chosen: str) -> Mapping:
    if mapping.truth is None:
        raise UsageError(
            f"--truth {truth}: the mapping {chosen} has no [truth] that names its columns"
        )
    rows = mapping.truth.model_copy(
        update={"file": str(truth.absolute()), "table": "", "optional": False}
    )
    return mapping.model_copy(update={"truth": rows})


@dataclass(frozen=True)
class NewRun:
    """A run to be made; its name derives from its start and vehicle."""

    flight: ImportedFlight
    original: Path
    source: str = ""  # what `source_named` returned
    progress: Callable[[float], None] = lambda share: None

    @property
    def start(self) -> datetime:
        return datetime.fromtimestamp(int(self.flight.imu.stamps_ns[0]) * 1e-9, UTC)

    def write(self, folder: Path, run_id: str, operator: str = "") -> Path:
        """Write `folder`/`run_id`, atomically. Raises StorageError."""
        metadata = {
            "run_id": run_id,
            "operator": operator,
            "started": self.start.isoformat(),
            "imported_from": shown(self.original),
            "imported_as": self.flight.source,
            SOURCE: self.source,
            "import_notes": "; ".join(self.flight.notes),
        }
        return written(
            folder / run_id, lambda log: write_run(log, self.flight, metadata, self.progress)
        )


@dataclass(frozen=True)
class ExportedRun:
    """A run of quadlab that was exported as tables."""

    tables: Sequence[TopicTable]
    original: Path
    vehicle: str

    @property
    def start(self) -> datetime:
        first = min(int(one.columns[RECEIVED].min()) for one in self.tables)
        return datetime.fromtimestamp(first * 1e-9, UTC)

    def write(self, folder: Path, run_id: str) -> Path:
        """Write `folder`/`run_id`, atomically. Raises StorageError."""
        told = {**self.tables[0].run, "run_id": run_id, "vehicle": self.vehicle}
        told["imported_from"] = shown(self.original)
        tables = list(self.tables)
        return written(folder / run_id, lambda log: write_exported(log, tables, self.vehicle, told))


def written(run: Path, write: Callable[[Path], None]) -> Path:
    """Write a run's folder with its log, atomically, and return it. Raises StorageError."""
    folder = run.parent.parent
    with (
        working_folder(folder, UNFINISHED) as making,
        os_errors(lambda why: f"cannot make {run}: {why}"),
    ):
        made = making / run.name
        write(made / STATION)
        made.rename(run)
    return run
