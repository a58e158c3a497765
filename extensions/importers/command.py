"""`quadlab log import FILE`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.log_commands.log_file import progress_of
from quadlab.option_types import File, Flag, Folder, optional
from quadlab.vehicle_names import check_name
from quadrotor.errors import LogFormatError, StorageError, UsageError

if TYPE_CHECKING:
    from extensions.importers.flight import ImportedFlight
    from extensions.importers.importing import ExportedRun, NewRun

ALL = "all"
READ = 0.7
"""Share of an import after which its run is written."""


@dataclass
class Import:
    """Import a flight that another system recorded, as a run, after a check of units, frames and
    clocks against gravity and motion (docs/importing.md)."""

    file: Annotated[tuple[Path, ...], tyro.conf.Positional, optional("FILE [FILE …]")]
    """the recorded flight: ULog, Betaflight's or ArduPilot's log, tlog, a ROS bag, µSD of a
    Crazyflie, CSV, Parquet, HDF5, NumPy, a folder that log export wrote; several files are parts
    of one flight"""
    mapping: Annotated[str | None, optional("NAME_OR_FILE")] = None
    """meaning of the columns: the name of a mapping that comes with quadlab, or a TOML file"""
    propose: File = None
    """write a mapping that names, units and values of the columns suggest, into a new TOML file,
    instead of importing"""
    truth: File = None
    """file of the mapping's [truth], instead of the one that it names"""
    table: Annotated[str | None, optional("TABLE")] = None
    """table of the IMU, instead of the mapping's; of Betaflight's logs the number in the file"""
    stamps: Annotated[Literal["header", "log", "clock"] | None, optional()] = None
    """time of the topics of ROS, instead of the mapping's: the header's stamp, when a message was
    logged, or the simulated time of /clock"""
    flight: Annotated[str | None, optional("NUMBER|all")] = None
    """which flight of a file with several, from 1; all: each becomes a run"""
    name: Annotated[str | None, optional()] = None
    """name of the vehicle (default: the mapping's)"""
    torn: Flag = False
    """import a truncated file up to where it ends"""
    data: Folder = None
    """data folder to which the run is added"""

    def run(self) -> int:
        if self.name is not None:
            check_name(self.name)
        if self.propose is not None:
            return self._propose(self.propose)
        from extensions.importers.exported import is_exported

        if self.file[0].exists() and is_exported(self.file[0]):
            return self._restore(self.file[0])
        imported = kept = 0
        numbers: list[int | None] = [None]
        try:
            numbers = self._numbers()
            known = self._known() if len(numbers) > 1 else {}
            for number in numbers:
                if run := known.get(self._source(number)):
                    print(f"flight {number} is imported already: {run}")
                    kept += 1
                else:
                    imported += self._import(number, len(numbers))
        except KeyboardInterrupt:
            done = f"imported {imported} of {len(numbers)}; the same command imports the others"
            if not imported:
                done = "imported none and left nothing behind; the same command begins anew"
            print(f"quadlab: interrupted; {done}", file=sys.stderr)
            raise
        if len(numbers) > 1:
            print(f"{imported + kept} of {len(numbers)} flights are imported")
        return 0 if imported + kept else 1

    def _import(self, number: int | None, count: int) -> bool:
        """Import a flight of `count`, and return whether it could be; a single one raises."""
        from extensions.importers.importing import shown

        which = f", flight {number} of {count}" if count > 1 else ""
        with progress_of(f"importing {shown(self.file[0])}{which}") as progress:
            try:
                flight = self._read(number, lambda share: progress(READ * share))
            except LogFormatError as error:
                if count == 1:
                    raise
                print(f"flight {number} is not imported: {error}", file=sys.stderr)
                return False
            run = self._add(flight, number, lambda share: progress(READ + (1.0 - READ) * share))
        self._tell(flight, run, number if count > 1 else None)
        return True

    def _known(self) -> dict[str, Path]:
        """Return the imported runs of the data folder by the flights that they are of."""
        from console.catalogue.catalogue import runs_in
        from extensions.importers.importing import SOURCE
        from flight_log.summary import summarize

        found = {}
        for run in runs_in(open_data_folder(self.data) / "runs"):
            with suppress(LogFormatError, StorageError):  # `log check` says what is wrong with it
                if source := summarize(run).run.get(SOURCE):
                    found[source] = run
        return found

    def _source(self, number: int | None) -> str:
        from extensions.importers.importing import source_named

        chosen = (self.table, self.stamps, self.name, number)
        return source_named(self.file[0], self.mapping, *chosen)

    def _restore(self, path: Path) -> int:
        """Add a run that was exported to the data folder."""
        from extensions.importers.exported import read_exported
        from extensions.importers.importing import DEFAULT_VEHICLE, ExportedRun, shown

        tables, notes = read_exported(path)
        vehicle = self.name or tables[0].run.get("vehicle", DEFAULT_VEHICLE)
        run = _entered(ExportedRun(tables, path, vehicle), vehicle, self.data)
        rows = sum(len(one.columns["time"]) for one in tables)
        print(f"{shown(path)} (exported by quadlab): {rows} messages of {len(tables)} topics")
        for note in notes:
            print(f"  {note}")
        print(run)
        return 0

    def _numbers(self) -> list[int | None]:
        """Return the numbers of the flights to import. Raises UsageError."""
        from extensions.importers.importing import flights_of, shown

        if self.flight is None:
            return [None]
        if len(self.file) > 1:
            raise UsageError("--flight is for one file; several files are parts of one flight")
        if self.flight == ALL:
            with progress_of(f"looking for flights in {shown(self.file[0])}") as progress:
                count = flights_of(
                    self.file[0],
                    self.mapping,
                    table=self.table,
                    stamps=self.stamps,
                    progress=progress,
                )
            return list(range(1, count + 1))
        if not self.flight.isdecimal() or not int(self.flight):
            raise UsageError(f"--flight {self.flight}: a number from 1, or all, is needed")
        return [int(self.flight)]

    def _read(self, number: int | None, progress: Callable[[float], None]) -> ImportedFlight:
        from extensions.importers.importing import read_flight

        first, *more = self.file
        return read_flight(
            first,
            self.mapping,
            more=more,
            truth=self.truth,
            table=self.table,
            stamps=self.stamps,
            flight=number,
            torn=self.torn,
            progress=progress,
        )

    def _add(
        self, flight: ImportedFlight, number: int | None, progress: Callable[[float], None]
    ) -> Path:
        """Add a flight to the data folder, and return its run."""
        from extensions.importers.importing import NewRun

        flight.vehicle = self.name or flight.vehicle
        new = NewRun(flight, self.file[0], self._source(number), progress)
        return _entered(new, flight.vehicle, self.data)

    def _tell(self, flight: ImportedFlight, run: Path, number: int | None) -> None:
        """Print what was imported and found."""
        from extensions.importers.importing import shown

        imu = flight.imu.stamps_ns
        seconds = 1e-9 * float(imu[-1] - imu[0])
        which = f", flight {number}" if number else ""
        files = ", ".join(map(shown, self.file))
        print(f"{files}{which} ({flight.source}): {seconds:.1f} s, {len(imu)} IMU samples")
        for note in flight.notes:
            print(f"  {note}")
        lacks = [name for name in ("truth", "estimate") if getattr(flight, name) is None]
        if lacks:
            print(f"  it has no {' and no '.join(lacks)}")
        print(run)

    def _propose(self, target: Path) -> int:
        from extensions.importers.importing import shown
        from extensions.importers.proposal import propose

        if self.mapping is not None:
            raise UsageError("--propose finds a mapping: leave out --mapping")
        if len(self.file) > 1:
            raise UsageError("--propose reads one file: give the first one of the flight")
        for line in propose(self.file[0], target):
            print(line)
        print(f"{target}: correct what is wrong in it, then import the flight with")
        print(f"  quadlab log import {shown(self.file[0])} --mapping {target}")
        return 0


def _entered(new: NewRun | ExportedRun, vehicle: str, data: Folder) -> Path:
    """Write a run into the data folder, and enter it in its catalogue."""
    from console.catalogue.catalogue import Catalogue, run_name
    from console.runs.adoption import described

    with closing(Catalogue(open_data_folder(data))) as catalogue:
        run = new.write(catalogue.folder, run_name(new.start, vehicle, catalogue.folder))
        catalogue.add(described(run, None))
    return run
