"""Lighthouse sweeps in a Crazyflie's log: when and at which angles planes of light met its deck.

`lhAngle` has the angles of both planes of a base station together, as soon as the firmware has
processed them: up to 12 ms after the light, depending on what was received next. Those of
Lighthouse 2 are therefore stamped by their pulses (`lhUartFrame`), those of Lighthouse 1 by the
rotor, at the end of whose half turn they are written. Positions and calibration of the base
stations are in the `system-config.yaml` that cfclient writes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from extensions.importers.frames import quaternion_of
from extensions.importers.readers.tables import Source
from quadrotor.errors import LogFormatError
from quadrotor.records import MAX_SENSORS, SWEEP_PLANE, SWEEPS_SAMPLE, Array, Record

ANGLES, PULSES = "lhAngle", "lhUartFrame"
GEOMETRY = "system-config.yaml"
SENSORS_B = np.array([[x, y, 0.0] for x in (-0.015, 0.015) for y in (0.0075, -0.0075)])
"""Positions, in m, of the four sensors of the Lighthouse deck."""
SIGMA = 4e-4
"""Standard deviation of one angle, in rad, including the residual of its calibration."""
APART = 3.0
"""Milliseconds between the angles of two turns of a rotor."""
LATEST = 30.0
"""Longest time, in ms, between a pulse and the record of its angle."""
TICKS, WRAP = 24e3, 2.0**32
"""Ticks of the receiver's clock per ms, and the count at which it wraps around."""
HALF_TURN = {1: 1e3 / 120.0, 2: 10.0}
"""Duration, in ms, of a rotor's half turn, by make."""
SECOND_ROTOR = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from the frame of a Lighthouse 1's vertical rotor to its station's."""


def read_sweeps(source: Source, base: float, notes: list[str]) -> Record | None:
    """Return the SWEEPS_SAMPLE (N,) of a log, in order, in the stations' world; None without them.

    Args:
        base: stamps are in ns after it, s. notes: gets lines about what was left out.

    Raises LogFormatError.
    """
    path = source.path.with_name(GEOMETRY)
    if ANGLES not in source.tables():
        return None
    if not path.is_file():
        notes.append(f"[{ANGLES}] is left out: {GEOMETRY}, with the base stations, is not with it")
        return None
    make, planes = read_stations(path)
    columns = ["timestamp", "basestation", "sweep", "sensor", "angle"]
    rows = source.read(ANGLES, columns)
    known = np.isin(2 * rows[:, 1] + rows[:, 2], list(planes)) & (rows[:, 3] < len(SENSORS_B))
    rows = rows[known & np.isfinite(rows[:, 4])]
    pulses = _pulses(source) if make == 2 and PULSES in source.tables() else {}
    out = []
    for turn in _turns(rows):
        for sweep in (0, 1):
            met = turn[turn[:, 2] == sweep][:MAX_SENSORS]
            if not len(met):
                continue
            number = 2 * int(met[0, 1]) + sweep
            if make == 2:
                at = _newest(pulses.get(number), turn[0, 0])
            else:
                late = HALF_TURN[1] * (0.52 + (1 - sweep) - met[:, 4].mean() / math.pi)
                at = turn[0, 0] - late
            if at is None:
                continue
            one = np.zeros((), SWEEPS_SAMPLE)
            one["stamp_ns"] = round(1e6 * at - 1e9 * base)
            one["count"], one["sigma"], one["number"] = len(met), SIGMA, number
            one["plane"] = planes[number]
            one["sensor_b"][: len(met)] = SENSORS_B[met[:, 3].astype(int)]
            one["angle"][: len(met)] = met[:, 4]
            out.append(one)
    found = np.array(out, SWEEPS_SAMPLE)
    return found[np.argsort(found["stamp_ns"], kind="stable")]


def _turns(rows: Array) -> Iterator[Array]:
    """Yield the rows of each turn of a base station's rotor, as soon as they are all written.

    Firmware that crosses beams writes both stations together, with the angles of the one again that
    has not turned since; these are left out.
    """
    last: dict[float, Array] = {}
    for written in np.split(rows, np.flatnonzero(np.diff(rows[:, 0]) > APART) + 1):
        for station in np.unique(written[:, 1]):
            turn = written[written[:, 1] == station]
            before = last.get(station)
            last[station] = turn
            if before is None or not np.isin(turn[:, 4], before[:, 4]).all():
                yield turn


def read_stations(path: Path) -> tuple[int, dict[int, Record]]:
    """Return the make of the base stations and their planes by number, two for each station."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        geometry: Any = YAML(typ="safe").load(path)
        make, planes = int(geometry["systemType"]), {}
        for station, place in geometry["geos"].items():
            turn = np.array(place["rotation"], float)
            for sweep, numbers in enumerate(geometry["calibs"][station]["sweeps"]):
                plane = np.zeros((), SWEEP_PLANE)
                upright = make == 1 and sweep == 1
                matrix = turn @ SECOND_ROTOR if upright else turn
                plane["origin_w"], plane["quaternion_wr"] = place["origin"], quaternion_of(matrix)
                slant = 0.0 if make == 1 else (2 * sweep - 1) * math.pi / 6
                plane["tilt"] = slant - numbers["tilt"]
                plane["phase"], plane["gib_magnitude"] = numbers["phase"], numbers["gibmag"]
                plane["gib_phase"] = numbers["gibphase"] + (0.0 if make == 1 else math.pi / 2)
                plane["curve"] = numbers["curve"] if make == 1 else 0.0
                planes[2 * int(station) + sweep] = plane
    except (
        OSError,
        YAMLError,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        RecursionError,
    ) as error:
        raise LogFormatError(
            f"{path.name} next to the log is not a configuration of base stations: {error!r:.80}"
        ) from None
    return make, planes


def _pulses(source: Source) -> dict[int, Array]:
    """Return when each plane met the deck, in ms of the log, by the receiver's clock.

    Pulses reach the log with delays of up to 2 ms; the smallest delays count as zero.
    """
    rows = source.read(PULSES, ["timestamp", "basestation", "offset", "timestamp2FPGA"])
    rows = rows[rows[:, 2] > 0.0]  # one in each block of sensors has the rotor's angle
    if len(rows) < 2:
        return {}
    ticks = np.unwrap(rows[:, 3], period=WRAP) / TICKS
    delay = rows[:, 0] - ticks
    delay = np.polyval(np.polyfit(ticks, delay, 1), ticks) - delay
    at = rows[:, 0] + delay - np.percentile(delay, 95)
    number = 2 * rows[:, 1] + (rows[:, 2] > HALF_TURN[2] * TICKS)
    return {int(one): at[number == one] for one in np.unique(number)}


def _newest(pulses: Array | None, at: float) -> float | None:
    """Return the newest pulse before a time, ms; None when there is none that fits."""
    if pulses is None or (k := int(np.searchsorted(pulses, at)) - 1) < 0:
        return None
    return float(pulses[k]) if at - pulses[k] < LATEST else None
