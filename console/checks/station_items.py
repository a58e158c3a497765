"""Start-up checks made by the station: the vehicle's clock, rates, the disk's speed."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

from console.checks.facts import Facts
from console.parameters.station import StationParameters
from vehicle_link.checks import Check, State
from vehicle_link.messages.records import LinkStatus

ROUND_TRIP = 0.02
"""Seconds above which the round trip gets a warning: every measurement is that much older at the
vehicle."""
NEARLY, HALF = 0.9, 0.5
"""Shares of a nominal rate: below the first it gets a warning, below the second it fails."""
PROBE = 4_000_000
SLOWEST = 5.0
"""Lowest speed in MB/s; a run at full rate writes about a fifth of it."""


def vehicle_clock(f: Facts, link_status: LinkStatus | None) -> Check:
    name, wanted = "vehicle's clock", f"known, round trip below {1e3 * ROUND_TRIP:.0f} ms"
    if not f.clock_known or link_status is None:
        advice = "connect the vehicle, then check again"
        return Check(name, "unknown", "not known yet", wanted, advice)
    trip, offset = float(link_status.round_trip), float(link_status.clock_offset)
    state: State = "ok" if trip <= ROUND_TRIP else "warn"
    found = f"{1e3 * offset:+.1f} ms from ours, round trip {1e3 * trip:.1f} ms"
    return Check(name, state, found, wanted, "find what is loading the network")


def rates(f: Facts, p: StationParameters) -> list[Check]:
    """Check the rates of received and sent messages against their nominal values.

    Telemetry is compared with what the vehicle sends: several on one computer send less often.
    """
    packets = max(f.telemetry_rate / (1.0 - f.loss), p.preflight.telemetry_rate_min)
    is_connected = f.mode is not None
    return [
        _rate("telemetry", f.telemetry_rate if is_connected else None, packets, "check the link"),
        _rate(
            "flight loop",
            f.tick_rate if is_connected else None,
            f.nominal_rate,
            "check the microcontroller's cables and the load of the vehicle's computer",
        ),
        _real_time(f),
        _rate(
            "tracker",
            f.tracker_rate,
            f.tracker_nominal,
            "is the tracking system (or the simulator) running?",
        ),
        _rate(
            "bearings",
            f.bearings_rate,
            f.bearings_nominal,
            "they are made from the tracker's poses or by a camera on board: check it, and the "
            "beacons in sight",
        ),
    ]


def disk_speed(f: Facts, folder: Path, data: Path) -> Check:
    """Measure the disk's speed with a small synced file, which is removed again.

    Never during a flight: only when the vehicle reports that it is disarmed.
    """
    name, wanted = "disk's speed", f"at least {SLOWEST:.0f} MB/s"
    if f.armed or f.mode is None:
        why = "is armed" if f.armed else "sends nothing, and may be flying"
        advice = "check again with the vehicle connected and disarmed"
        return Check(name, "unknown", f"not measured: the vehicle {why}", wanted, advice)
    path, block = folder / ".speed", os.urandom(PROBE)
    try:
        began = time.perf_counter()
        with path.open("wb") as file:
            file.write(block)
            file.flush()
            os.fsync(file.fileno())
        spent = time.perf_counter() - began
    except OSError as error:
        advice = f"correct the permissions of {folder}, or choose another folder with --data"
        return Check(name, "fail", f"cannot write ({error.strerror})", wanted, advice)
    finally:
        with suppress(OSError):
            path.unlink()
    speed = 1e-6 * PROBE / spent
    advice = f"move {data} to a quicker disk; a slow one loses messages of a run"
    return Check(name, "ok" if speed >= SLOWEST else "fail", f"{speed:.0f} MB/s", wanted, advice)


def _rate(name: str, found: float | None, nominal: float, advice: str) -> Check:
    wanted = f"{nominal:.0f} Hz"
    if found is None:
        return Check(name, "unknown", "nothing received", wanted, "connect the vehicle")
    share = found / nominal if nominal > 0.0 else 1.0
    state: State = "ok" if share >= NEARLY else "warn" if share >= HALF else "fail"
    return Check(name, state, f"{found:.0f} Hz", wanted, advice)


def _real_time(f: Facts) -> Check:
    name, wanted = "flight process", "real time"
    if f.mode is None:
        return Check(name, "unknown", "nothing received", wanted, "connect the vehicle")
    if "not_real_time" in f.flags:
        advice = "see real-time rights and locked memory of the vehicle; then restart it"
        return Check(name, "warn", "not real time: late under load", wanted, advice)
    return Check(name, "ok", "real time", wanted)
