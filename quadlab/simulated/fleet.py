"""The simulated vehicles of one `quadlab up`: names, ports, folders and rates."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from quadlab.vehicle_names import THE_VEHICLE
from quadrotor.errors import StorageError, UsageError
from vehicle_link.security.authority import TlsFiles
from vehicle_link.serial.capacity import DEFAULT_RATE

MAX_VEHICLES = 8
PORT_STEP = 2
"""Difference between the link ports of two vehicles: the port after each is its telemetry's."""


@dataclass(frozen=True, slots=True)
class Rates:
    """Rates of each vehicle, Hz; vehicles that share a processor get lower ones."""

    ticks: int
    packets: int
    poses: int
    bearings: int


ALONE = Rates(DEFAULT_RATE, 100, 100, 30)
SOME = Rates(100, 33, 30, 10)
MANY = Rates(60, 12, 15, 3)
FEW = 3
"""Largest number of vehicles that fly at `SOME`."""


@dataclass(frozen=True, slots=True)
class SimulatedFleet:
    """`count` vehicles; a single one is called `name`, several quad1, quad2, …"""

    count: int
    name: str
    link_port: int

    def check(self) -> None:
        """Check the options of the fleet. Raises UsageError."""
        if not 1 <= self.count <= MAX_VEHICLES:
            raise UsageError(
                f"--vehicles {self.count} is not possible; allowed are 1 to {MAX_VEHICLES}"
            )
        if self.count > 1 and self.name != THE_VEHICLE:
            raise UsageError(
                "several vehicles are called quad1, quad2, …; leave out --name or --vehicles"
            )

    @property
    def names(self) -> tuple[str, ...]:
        if self.count == 1:
            return (self.name,)
        return tuple(f"quad{number}" for number in range(1, self.count + 1))

    @property
    def ports(self) -> dict[str, int]:
        """Return the UDP port of each vehicle's link."""
        return {name: self.link_port + PORT_STEP * k for k, name in enumerate(self.names)}

    @property
    def rates(self) -> Rates:
        """Return the default rates."""
        return ALONE if self.count == 1 else SOME if self.count <= FEW else MANY

    @property
    def vehicle_words(self) -> list[str]:
        return [] if self.count == 1 else ["--telemetry", str(self.rates.packets)]

    @property
    def station_words(self) -> list[str]:
        if self.count == 1:
            return []
        rates = self.rates
        settings = (
            f"tracker.rate={rates.poses}",
            f"bearings.rate={rates.bearings}",
            f"preflight.telemetry_rate_min={rates.packets // 8 * 5}",
            f"preflight.pose_age_max={max(0.1, 3.0 / rates.poses):g}",
        )
        return [word for setting in settings for word in ("--set", setting)]

    def folder(self, data: Path, name: str, files: TlsFiles) -> Path:
        """Return the vehicle's own data folder, with the certificates that a vehicle needs.

        Raises StorageError.
        """
        if self.count == 1:
            return data
        folder = data / "vehicles" / name
        copies = TlsFiles(folder / "certificates")
        try:
            copies.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            for source, copy in (
                (files.authority, copies.authority),
                (files.certificate("vehicle"), copies.certificate("vehicle")),
                (files.key("vehicle"), copies.key("vehicle")),
            ):
                shutil.copy2(source, copy)
            for shared in ("trajectories", "plugins"):
                link = folder / shared
                if not link.is_symlink() and not link.exists():
                    link.symlink_to(Path("..", "..", shared))
        except OSError as error:
            raise StorageError(f"cannot make {folder}: {error.strerror or error}") from error
        return folder
