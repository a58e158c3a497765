"""The vehicles that were enrolled on this base, and those that the station connects to.

They are `known_vehicles.toml` and `station.json` in the data folder.
"""

from __future__ import annotations

import datetime
import json
import tomllib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from console.atomic_file import replacing
from quadrotor.errors import StorageError, UsageError, os_errors
from vehicle_link.addresses import parse_endpoint

FILE, STATION_FILE = "known_vehicles.toml", "station.json"


@dataclass(frozen=True, slots=True)
class KnownVehicle:
    name: str
    address: str  # host:port, or host
    enrolled: str  # date


class KnownVehicles:
    """The known vehicles, read from the file at each call, as another process may have enrolled
    one. Raises StorageError.
    """

    def __init__(self, data: Path) -> None:
        self.path = data / FILE

    def all(self) -> dict[str, KnownVehicle]:
        """Return the known vehicles by name, in the order of their enrolment."""
        try:
            text = self.path.read_text()
        except FileNotFoundError:
            return {}
        except (OSError, UnicodeDecodeError) as error:
            raise StorageError(f"cannot read {self.path}: {error}") from error
        try:
            rows = tomllib.loads(text)
            found = {
                name: KnownVehicle(name, str(row["address"]), str(row.get("enrolled", "")))
                for name, row in rows.items()
            }
            for one in found.values():
                parse_endpoint(one.address)
        except (
            ValueError,
            KeyError,
            TypeError,
            AttributeError,
            UsageError,
            RecursionError,
        ) as error:
            raise StorageError(
                f"{self.path} cannot be read ({error}); correct it, or delete it and enrol the "
                "vehicles again"
            ) from error
        return found

    def resolved(self, words: Iterable[str]) -> list[str]:
        """Return words of a command line, with the name of each known vehicle replaced by
        `name=host:port`.
        """
        known = self.all()
        return [f"{word}={known[word].address}" if word in known else word for word in words]

    def add(self, name: str, address: str) -> None:
        """Add a vehicle, or change its address. Raises UsageError for an invalid address."""
        parse_endpoint(address)
        vehicles = self.all()
        today = datetime.date.today().isoformat()
        self._write({**vehicles, name: KnownVehicle(name, address, today)})

    def forget(self, name: str) -> None:
        """Remove a vehicle. Raises UsageError when it is unknown."""
        vehicles = self.all()
        if name not in vehicles:
            known = ", ".join(vehicles) or "none"
            raise UsageError(f"no vehicle is called {name!r}; known are: {known}")
        del vehicles[name]
        self._write(vehicles)

    def _write(self, vehicles: dict[str, KnownVehicle]) -> None:
        lines = [
            f'[{one.name}]\naddress = "{one.address}"\nenrolled = "{one.enrolled}"\n'
            for one in vehicles.values()
        ]
        _write(self.path, "\n".join(lines))


def write_station_vehicles(data: Path, names: Sequence[str]) -> None:
    """Write the names of the vehicles that the station connects to. Raises StorageError."""
    _write(data / STATION_FILE, json.dumps({"vehicles": list(names)}))


def station_vehicles(data: Path) -> tuple[str, ...]:
    """Return the vehicles of the station's newest start; empty when there was none."""
    with suppress(OSError, ValueError, TypeError, KeyError):
        names = json.loads((data / STATION_FILE).read_text())["vehicles"]
        return tuple(name for name in names if isinstance(name, str))
    return ()


def _write(path: Path, text: str) -> None:
    with os_errors(lambda why: f"cannot write {path}: {why}"), replacing(path) as new:
        new.write_text(text)
