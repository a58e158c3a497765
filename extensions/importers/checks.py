"""Units, frames and clocks of a recorded flight, checked against gravity and against motion.

A statement of the mapping that the flight contradicts is refused, with what fits; what the mapping
leaves out is found and noted. The specific force has the length of gravity in the median and
points up; the gyroscope must agree with the rotation of the tracks' attitudes; and the
acceleration of their positions must agree with the specific force, rotated by their attitudes.
"""

from __future__ import annotations

import numpy as np

from extensions.importers.flight import ImportedFlight, Imu
from extensions.importers.frames import axes, bodies
from extensions.importers.raw import RawFlight, RawImu, RawTrack
from extensions.importers.rows import blocks, nanoseconds, release, turn
from extensions.importers.tracks import Checked
from extensions.importers.trajectory import align
from extensions.importers.units import FORCE_UNITS, RATE_UNITS
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

GRAVITY = 9.80665
LIKELY_FORCE = (0.7, 1.6)
"""Range of the specific force's median length, in multiples of gravity."""
POINTS_UP = 0.7
"""Least upward component of the mean specific force, relative to its length."""
LARGEST_RATE = 36.0
"""rad/s: more than 2000 deg/s, which no gyroscope of a vehicle measures."""
FIRST_NS = 100_000_000_000_000_000
"""Stamps above it are epoch time (1973 and later), others are of another clock."""


def checked_flight(raw: RawFlight, vehicle: str, source: str, modified_ns: int) -> ImportedFlight:
    """Return the flight in our frames and units, on one clock.

    Args:
        modified_ns: when the file was written, for a log without a date.

    Raises LogFormatError with what was found and what to try.
    """
    notes = list(raw.notes)
    imu = raw.imu
    # In place, because a log may fill half of the memory that an import may take.
    force, turning = imu.specific_force, imu.angular_velocity
    turn(force, _force_unit(imu, notes) * np.eye(3))
    up = _body(imu, force, notes)
    turn(force, up)
    turn(turning, up)
    estimate = next((one for one in raw.tracks if one.name == "estimate"), None)
    found = [_checked(imu.seconds, force, turning, one, estimate, notes) for one in raw.tracks]
    scales = [one.rate_scale for one in found if one.rate_scale is not None]
    unit = _rate_unit(imu, turning, scales, notes)
    if not raw.tracks:
        notes.append("no truth and no estimate: frames are checked against gravity alone")
    base_ns = raw.base_ns
    if base_ns < FIRST_NS:
        epoch = raw.epoch_ns
        if epoch is None:
            ended = float(imu.seconds[-1]) + raw.later
            epoch = modified_ns - round(ended * 1e9) - base_ns
            notes.append("the log does not know its date: that of its file is taken")
        base_ns += epoch
    at = nanoseconds(imu.seconds, base_ns)
    made = {one.raw.name: one.track(base_ns) for one in found}
    turn(turning, unit * np.eye(3))
    flight = ImportedFlight(vehicle, source, Imu(at, force, turning), notes=notes)
    flight.truth, flight.estimate = made.get("truth"), made.get("estimate")
    if flight.truth and not flight.truth.attitude_known:
        notes.append(
            "[truth] has no attitude: error_state can be replayed on its positions, complementary "
            "cannot"
        )
    if flight.truth and flight.estimate:
        align(flight.truth, flight.estimate, raw.sweeps, notes)
    if raw.battery:
        seconds, voltage = raw.battery
        flight.battery = nanoseconds(seconds, base_ns), voltage
    if raw.sweeps is not None:
        flight.sweeps = raw.sweeps
        flight.sweeps["stamp_ns"] += base_ns
    flight.events = [(base_ns + round(t * 1e9), level, text) for t, level, text in raw.events]
    return flight


def _checked(
    seconds: Array,
    force: Array,
    turning: Array,
    raw: RawTrack,
    estimate: RawTrack | None,
    notes: list[str],
) -> Checked:
    """Return a checked track. An estimate may be wrong, which may be why its log is studied: if all
    its conventions are stated, a misfit is only noted. Raises LogFormatError.
    """
    kept = len(notes)
    try:
        other = None if raw is estimate else estimate
        return Checked(seconds, force, turning, raw, notes, estimate=other)
    except LogFormatError as error:
        rows = raw.rows
        stated = (rows.body, rows.world, rows.position_unit, rows.quaternion_order)
        if raw.name != "estimate" or None in (*stated, rows.quaternion_maps, rows.time_offset):
            raise
        del notes[kept:]
        notes.append(f"the estimate does not fit the IMU, and is kept as stated: {error}")
        return Checked(seconds, force, turning, raw, notes, check=False)


def _force_unit(imu: RawImu, notes: list[str]) -> float:
    """Return the specific force's unit, m/s². Raises LogFormatError."""
    force = imu.specific_force
    squares = np.empty(len(force))
    for some in blocks(force):
        squares[some] = np.einsum("ni,ni->n", force[some], force[some])
    median = float(np.sqrt(np.median(squares, overwrite_input=True)))
    fits = [
        name
        for name, unit in FORCE_UNITS.items()
        if LIKELY_FORCE[0] < median * unit / GRAVITY < LIKELY_FORCE[1]
    ]
    stated = imu.rows.specific_force_unit
    finding = f"[imu] specific_force has a median length of {median:.4g}"
    if stated is None and not fits:
        raise LogFormatError(
            f"{finding}, which is gravity in none of {', '.join(FORCE_UNITS)}: "
            f"are these the right columns? A number as specific_force_unit is m/s^2 a count"
        )
    if stated is None:
        notes.append(f"{finding}: in {fits[0]}")
        return FORCE_UNITS[fits[0]]
    unit = FORCE_UNITS[stated] if isinstance(stated, str) else stated
    share = median * unit / GRAVITY
    if not LIKELY_FORCE[0] < share < LIKELY_FORCE[1]:
        hint = f'write "{fits[0]}"' if fits else "are these the right columns?"
        raise LogFormatError(
            f"{finding}, {share:.3g} times gravity in the {stated} of the mapping: {hint}"
        )
    return unit


def _body(imu: RawImu, force: Array, notes: list[str]) -> Array:
    """Return the matrix into FLU. Raises LogFormatError."""
    mean = np.sum([force[some].sum(axis=0) for some in blocks(force)], axis=0) / len(force)
    length = float(np.linalg.norm(mean))
    stated = imu.rows.body
    finding = f"[imu] the mean specific force is ({', '.join(f'{one:.2f}' for one in mean)}) m/s^2"
    if length < 0.5 * GRAVITY:
        raise LogFormatError(f"{finding}, too small for gravity: has gravity been removed already?")
    fits = [one for one in bodies() if (axes(one, "") @ mean)[2] > POINTS_UP * length]
    if stated is None:
        if fits[:1] not in (["FLU"], ["FRD"]):
            raise LogFormatError(
                f"{finding}: z is not the vertical; write body, one of {', '.join(fits)}"
            )
        notes.append(f"{finding}: the body is {fits[0]}")
        return axes(fits[0], "body")
    matrix = axes(stated, "body")
    if (matrix @ mean)[2] < POINTS_UP * length:
        hint = ", ".join(fits[:4])
        raise LogFormatError(f"{finding}, not upwards in the {stated} of the mapping: try {hint}")
    return matrix


def _usual_largest(values: Array) -> float:
    """Return the length that one of a thousand values exceeds."""
    lengths = np.abs(values)
    release(values)
    return float(np.percentile(lengths, 99.9, overwrite_input=True))


def _rate_unit(imu: RawImu, turning: Array, scales: list[float], notes: list[str]) -> float:
    """Return the gyroscope's unit, rad/s.

    Args:
        scales: gyroscope reading per rad/s of the tracks' attitudes.

    Raises LogFormatError.
    """
    stated = imu.rows.angular_velocity_unit
    if scales:
        finding = f"[imu] angular_velocity is {scales[0]:.4g} times the turning of the attitudes"
        found = next((n for n, unit in RATE_UNITS.items() if 0.75 < scales[0] * unit < 1.33), None)
    else:
        found, finding = None, ""
        if stated in (None, "rad/s"):
            largest = max(map(_usual_largest, turning.T))
            finding = f"[imu] angular_velocity reaches {largest:.4g}"
            found = "deg/s" if largest > LARGEST_RATE else None
    if stated is None:
        if found is None:
            raise LogFormatError(
                f"{finding}: the unit cannot be found from it; write angular_velocity_unit, one of "
                f"{', '.join(RATE_UNITS)}, or a number (rad/s a count)"
            )
        notes.append(f"{finding}: in {found}")
        return RATE_UNITS[found]
    unit = RATE_UNITS[stated] if isinstance(stated, str) else stated
    wrong = not 0.75 < scales[0] * unit < 1.33 if scales else found is not None
    if wrong:
        hint = f'write "{found}"' if found else "are these the right columns?"
        raise LogFormatError(f"{finding}, which is not the {stated} of the mapping: {hint}")
    if not scales:
        notes.append(f"the unit of [imu] angular_velocity ({stated}) could not be checked")
    return unit
