"""Import of a recorded flight of another system as a run."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from extensions.importers.checks import checked_flight
from extensions.importers.flight import ImportedFlight
from extensions.importers.mapping import Mapping, load_mapping, names
from extensions.importers.raw import read_raw
from extensions.importers.readers.formats import format_of
from extensions.importers.run_writer import write_run
from flight_log.run_folder import STATION
from quadrotor.errors import StorageError, UsageError, os_errors

DEFAULT_VEHICLE = "imported"
DEFAULTS = {"mcap": "rosbag", "dataflash": "ardupilot", "tlog": "mavlink"}
"""Mappings of formats that have none of their own name."""
EXAMPLE = "--mapping NAME_OR_FILE"


def read_flight(
    path: Path,
    mapping: str | None = None,
    *,
    truth: Path | None = None,
    table: str | None = None,
    torn: bool = False,
) -> ImportedFlight:
    """Read and check a recorded flight.

    Args:
        mapping: name or file; None: the format's default.
        truth: the file of its [truth], instead of the one that the mapping names.
        table: the table of its [imu], and of sections with the same table, instead of the
            mapping's.
        torn: whether a truncated file is read up to its end.

    Raises LogFormatError, StorageError or UsageError with what was found and what to try.
    """
    kind = format_of(path)
    if mapping is None:
        mapping = DEFAULTS.get(kind, kind)
        if mapping not in names():
            raise UsageError(
                f"{path.name} is {kind}, whose columns can be anything: say with {EXAMPLE} which "
                f"are what; there are {', '.join(names())} (docs/importing.md)"
            )
    found = load_mapping(mapping)
    if truth is not None:
        found = _with_truth(found, truth, mapping)
    if table is not None:
        found = found.with_table(table)
    raw = read_raw(path, found, torn=torn)
    vehicle = re.sub(r"[^a-z0-9_]", "_", found.vehicle.lower()) or DEFAULT_VEHICLE
    modified_ns = path.stat().st_mtime_ns
    flight = checked_flight(raw, vehicle, f"{kind}, mapping {Path(mapping).name}", modified_ns)
    flight.parameters = found.parameters
    return flight


def shown(path: Path) -> str:
    """Return a file's name as text; a byte that is no UTF-8 becomes a replacement character."""
    return os.fsencode(path.name).decode(errors="replace")


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
            "import_notes": "; ".join(self.flight.notes),
        }
        with os_errors(lambda why: f"cannot write in {folder.parent}: {why}"):
            making = Path(tempfile.mkdtemp(prefix=".import-", dir=folder.parent))
        try:
            made = making / run_id
            write_run(made / STATION, self.flight, metadata)
            made.rename(folder / run_id)
        except OSError as error:
            raise StorageError(f"cannot make {folder / run_id}: {error.strerror}") from error
        finally:
            shutil.rmtree(making, ignore_errors=True)
        return folder / run_id
