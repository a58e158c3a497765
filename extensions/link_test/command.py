"""`quadlab link test [VEHICLE]`."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import Flag, Folder, optional
from quadlab.vehicle_names import check_name
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from extensions.link_test.measurement import Figures
    from extensions.link_test.verdict import Grade

SHORTEST, LONGEST = 2.0, 600.0


@dataclass
class Test:
    """Connect to a vehicle, measure the link for some seconds, and judge it."""

    vehicle: Annotated[tyro.conf.Positional[str], optional("[VEHICLE]")] = ""
    """name of a known vehicle, or host:port (default: the only known one, else this machine)"""
    name: Annotated[str, optional("NAME")] = ""
    """namespace of the vehicle's topics (default: the name that it announces)"""
    seconds: float = 8.0
    """duration of the measurement, s"""
    json: Flag = False
    """print the figures as JSON"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        if self.name:
            check_name(self.name)
        if not SHORTEST <= self.seconds <= LONGEST:
            raise UsageError(
                f"--seconds {self.seconds:g} is not allowed; allowed are {SHORTEST:g} to "
                f"{LONGEST:g}"
            )
        data = open_data_folder(self.data)
        endpoint, name = _place(data, self.vehicle)

        from extensions.link_test.measurement import measure
        from extensions.link_test.verdict import verdict
        from vehicle_link.addresses import parse_endpoint
        from vehicle_link.security.authority import ensure_certificates

        tls = ensure_certificates(data / "certificates", [parse_endpoint(endpoint)[0]])
        figures = measure(endpoint, tls, self.seconds, self.name or name, _say)
        grade, lines = verdict(figures)
        if self.json:
            print(json.dumps(_row(figures, grade, lines), indent=1))
        else:
            print("\n".join(_table(figures)))
            print("\n".join([f"verdict: {grade}", *lines]))
        return 1 if grade == "bad" else 0


def _say(text: str) -> None:
    print(f"{text} …", file=sys.stderr, flush=True)


def _place(data: Path, word: str) -> tuple[str, str]:
    """Return (endpoint, name or "") of the vehicle to test. Raises UsageError, StorageError."""
    from console.link.known_vehicles import KnownVehicles

    known = KnownVehicles(data).all()
    if not word:
        if len(known) > 1:
            raise UsageError(f"give the vehicle to test: {', '.join(known)}, or an address")
        return next(((one.address, one.name) for one in known.values()), ("127.0.0.1", ""))
    if word in known:
        return known[word].address, word
    return word, next((one.name for one in known.values() if one.address == word), "")


def _row(figures: Figures, grade: Grade, lines: list[str]) -> dict[str, object]:
    from extensions.link_test.verdict import percentile

    row = {
        "address": figures.address,
        "vehicle": figures.vehicle,
        "access": figures.access,
        "version": figures.version,
        "round_trip_p50_s": percentile(figures.round_trips, 50),
        "round_trip_p99_s": percentile(figures.round_trips, 99),
        "answered": len(figures.round_trips),
        "unanswered": figures.unanswered,
        "telemetry_rate_hz": figures.rate,
        "telemetry_loss": figures.loss,
        "jitter_s": figures.jitter,
        "throughput_bit_s": figures.throughput,
        "clock_offset_s": figures.clock_offset,
        "verdict": grade,
        "reasons": lines,
    }
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value
        for key, value in row.items()
    }


def _table(figures: Figures) -> list[str]:
    row = _row(figures, "good", [])

    def shown(name: str, scale: float, unit: str) -> str:
        value = row[name]
        return f"{value * scale:.3g} {unit}" if isinstance(value, float) else "not measured"

    asked = len(figures.round_trips) + figures.unanswered
    trip = f"p50 {shown('round_trip_p50_s', 1e3, 'ms')}, p99 {shown('round_trip_p99_s', 1e3, 'ms')}"
    loss = f"lost {shown('telemetry_loss', 100, '%')} of {figures.packets} packets"
    if math.isnan(figures.loss):
        loss = f"not measured, {figures.packets} packets"
    offset = figures.clock_offset
    ahead = f"{abs(offset) * 1e3:.1f} ms {'behind' if offset < 0 else 'ahead'}"
    clock = "not measured" if math.isnan(offset) else f"vehicle {ahead}"
    least = "" if math.isnan(figures.throughput) else "at least "
    return [
        f"{figures.vehicle} at {figures.address}, quadlab {figures.version}, we are its "
        f"{figures.access}",
        f"  round trip   {trip}, {figures.unanswered} of {asked} not answered",
        f"  telemetry    {loss}, {figures.rate:.0f} Hz",
        f"  jitter       {shown('jitter_s', 1e3, 'ms')}",
        f"  throughput   {least}{shown('throughput_bit_s', 1e-6, 'Mbit/s')}, in the background",
        f"  clock        {clock}",
    ]
