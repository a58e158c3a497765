"""`quadlab log import FILE`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import File, Flag, Folder, optional
from quadlab.vehicle_names import check_name


@dataclass
class Import:
    """Import a flight that another system recorded, as a run, after a check of units, frames and
    clocks against gravity and motion (docs/importing.md)."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """the recorded flight: ULog, Betaflight's or ArduPilot's log, tlog, a ROS bag, µSD of a
    Crazyflie, CSV, HDF5, NumPy"""
    mapping: Annotated[str | None, optional("NAME_OR_FILE")] = None
    """meaning of the columns: the name of a mapping that comes with quadlab, or a TOML file"""
    truth: File = None
    """file of the mapping's [truth], instead of the one that it names"""
    table: Annotated[str | None, optional("TABLE")] = None
    """table of the IMU, instead of the mapping's; of Betaflight's logs the number in the file"""
    name: Annotated[str | None, optional()] = None
    """name of the vehicle (default: the mapping's)"""
    torn: Flag = False
    """import a truncated file up to where it ends"""
    data: Folder = None
    """data folder to which the run is added"""

    def run(self) -> int:
        if self.name is not None:
            check_name(self.name)
        from console.catalogue.catalogue import Catalogue, run_name
        from console.runs.adoption import described
        from extensions.importers.importing import NewRun, read_flight, shown

        flight = read_flight(
            self.file, self.mapping, truth=self.truth, table=self.table, torn=self.torn
        )
        flight.vehicle = self.name or flight.vehicle
        new = NewRun(flight, self.file)
        catalogue = Catalogue(open_data_folder(self.data))
        try:
            run_id = run_name(new.start, flight.vehicle, catalogue.folder)
            run = new.write(catalogue.folder, run_id)
            catalogue.add(described(run, None))
        finally:
            catalogue.close()
        imu = flight.imu.stamps_ns
        seconds = 1e-9 * float(imu[-1] - imu[0])
        print(f"{shown(self.file)} ({flight.source}): {seconds:.1f} s, {len(imu)} IMU samples")
        for note in flight.notes:
            print(f"  {note}")
        lacks = [name for name in ("truth", "estimate") if getattr(flight, name) is None]
        if lacks:
            print(f"  it has no {' and no '.join(lacks)}")
        print(run)
        return 0
