"""`quadlab doctor`: the information that a maintainer asks for first."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version

from quadlab.option_types import Folder
from quadrotor.checkout import DISTRIBUTION


@dataclass
class Doctor:
    """Print versions, computer and checks of this machine, for a report of a problem."""

    data: Folder = None
    """data folder to check"""

    def run(self) -> int:
        import os
        import platform

        import platformdirs

        from flight_log.provenance import provenance
        from quadlab.data_folder import FREE_SPACE_FLOOR
        from quadrotor.extensions import registry
        from vehicle.realtime import PRIORITY
        from vehicle_link import machine_checks as machine
        from vehicle_link.serial.devices import candidates

        folder = self.data or platformdirs.user_data_path("quadlab", appauthor=False)
        found = provenance()
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        lines = {
            DISTRIBUTION: f"{version(DISTRIBUTION)}, revision {found['git_revision']}"
            + (", changed" if found["git_dirty"] == "true" else ""),
            "versions": found["versions"],
            "system": f"{platform.platform()}, {os.cpu_count()} processors, {memory / 1e9:.1f} GB",
            "data folder": str(folder),
            "extensions": ", ".join(one.name for one in registry().extensions) or "none",
            "serial devices": ", ".join(candidates()) or "none",
        }
        for name, text in lines.items():
            print(f"{name:20}{text}")
        checks = (
            machine.clock_check("station"),
            machine.governor_check("station"),
            machine.disk_check("station", "data folder", folder, FREE_SPACE_FLOOR),
            machine.real_time_check("station", PRIORITY),
            machine.memory_lock_check("station"),
        )
        for one in checks:
            advice = f"; {one.advice}" if one.state != "ok" and one.advice else ""
            print(f"{one.name:20}{one.state}: {one.found}{advice}")
        return 0
