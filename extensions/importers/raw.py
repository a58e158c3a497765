"""The columns that a mapping names, as they are in the files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from extensions.importers.files import Files
from extensions.importers.flights import FEWEST
from extensions.importers.mapping import (
    ORDERS,
    AttitudeRows,
    Attitudes,
    Columns,
    ImuRows,
    Mapping,
    Rows,
    TrackRows,
)
from extensions.importers.sweeps import read_sweeps
from quadrotor.errors import LogFormatError
from quadrotor.plain_rotations import conjugate, make_continuous
from quadrotor.records import Array, Record


@dataclass
class RawImu:
    """Samples in the file's units and axes; `seconds` since the flight's base."""

    rows: ImuRows
    seconds: Array  # (N,), rising
    specific_force: Array  # (N, 3)
    angular_velocity: Array  # (N, 3)


@dataclass
class RawTrack:
    """Poses in the file's units, axes and order."""

    name: str  # section of the mapping
    rows: TrackRows
    seconds: Array  # (N,), rising
    position: Array  # (N, 3)
    velocity: Array | None  # (N, 3)
    quaternion: Array | None  # (N, 4), unit


@dataclass
class RawFlight:
    """A file read by its mapping; times in s after `base_ns`, that of the IMU's first sample."""

    base_ns: int
    epoch_ns: int | None
    imu: RawImu
    tracks: list[RawTrack]
    battery: tuple[Array, Array] | None = None  # s, V
    events: list[tuple[float, int, str]] = field(default_factory=list)  # s, level, text
    notes: list[str] = field(default_factory=list)
    sweeps: Record | None = None  # (N,) SWEEPS_SAMPLE, ns after base
    later: float = 0.0  # s, of flights behind it in the file


def read_raw(
    paths: Sequence[Path], mapping: Mapping, *, torn: bool, flight: int | None = None
) -> RawFlight:
    """Read the files of a flight by its mapping; `torn` also accepts a truncated one.

    Args:
        flight: which flight of a file with several is read, from 1.

    Raises LogFormatError or StorageError.
    """
    with Files(paths, mapping, torn=torn, flight=flight) as files:
        rows = mapping.imu
        seconds, force, rate = files.read(
            rows,
            "imu",
            {
                "specific_force": (rows.specific_force, 3),
                "angular_velocity": (rows.angular_velocity, 3),
            },
        )
        tracks = [
            track
            for name in ("truth", "estimate")
            if (track := _track(files, name, getattr(mapping, name))) is not None
        ]
        battery = None
        if mapping.battery and not _left_out(files, mapping.battery):
            voltage = (mapping.battery.voltage, 1)
            found = files.read(mapping.battery, "battery", {"voltage": voltage})
            battery = (found[0], found[1][:, 0])
        source = files.source(rows)
        if source.epoch_ns is None and len(source.flights) > 1:
            files.notes.append("flights without a date all get that of the file")
        base = 1e-9 * files.base_ns
        events = [(time - base, level, text) for time, level, text in source.events]
        imu = RawImu(rows, seconds, force, rate)
        sweeps = read_sweeps(source, base, files.notes)
        return RawFlight(
            files.base_ns,
            source.epoch_ns,
            imu=imu,
            tracks=tracks,
            battery=battery,
            events=events,
            notes=files.notes,
            sweeps=sweeps,
            later=files.flights.later,
        )


def _track(files: Files, name: str, rows: TrackRows | None) -> RawTrack | None:
    if rows is None or _left_out(files, rows):
        return None
    columns: dict[str, tuple[Columns, int]] = {"position": (rows.position, 3)}
    if rows.velocity is not None:
        columns["velocity"] = (rows.velocity, 3)
    columns |= _attitude_columns(rows)
    seconds, position, *more = files.read(rows, name, columns)
    velocity = more.pop(0) if rows.velocity is not None else None
    quaternion = _quaternions(more.pop(0), rows, name) if more else None
    if rows.euler is not None:
        rows = rows.model_copy(update={"quaternion_order": "wxyz"})
    track = RawTrack(name, rows, seconds, position, velocity, quaternion)
    if rows.attitude is not None and not _left_out(files, rows.attitude):
        _join_attitude(files, track, rows.attitude)
    return track


def _join_attitude(files: Files, track: RawTrack, rows: AttitudeRows) -> None:
    """Interpolate the attitude of another table at the track's stamps, and trim the track to it."""
    section = f"{track.name}.attitude"
    times, found = files.read(rows, section, _attitude_columns(rows))
    found = _quaternions(found, rows, section)
    make_continuous(found)
    inside = (track.seconds >= times[0]) & (track.seconds <= times[-1])
    if inside.sum() < FEWEST:
        raise LogFormatError(f"[{section}] and [{track.name}] have no stamps in common")
    track.seconds, track.position = track.seconds[inside], track.position[inside]
    if track.velocity is not None:
        track.velocity = track.velocity[inside]
    turned = np.stack([np.interp(track.seconds, times, one) for one in found.T], axis=1)
    track.quaternion = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    order = "wxyz" if rows.euler is not None else rows.quaternion_order
    more = {"quaternion_order": order, "quaternion_maps": rows.quaternion_maps}
    track.rows = track.rows.model_copy(update=more)


def _left_out(files: Files, rows: Rows) -> bool:
    return rows.optional and rows.table not in files.source(rows).tables()


def _attitude_columns(rows: Attitudes) -> dict[str, tuple[Columns, int]]:
    if rows.quaternion is not None:
        return {"quaternion": (rows.quaternion, 4)}
    return {} if rows.euler is None else {"euler": (rows.euler, 3)}


def _quaternions(values: Array, rows: Attitudes, section: str) -> Array:
    """Return unit quaternions, in the file's order or (w, x, y, z) of Euler angles. Raises
    LogFormatError.
    """
    if rows.euler is None:
        return _unit(values, section)
    from scipy.spatial.transform import Rotation

    assert rows.euler_order is not None
    turned = Rotation.from_euler(rows.euler_order, values, degrees=rows.euler_unit == "deg")
    found: Array = turned.as_quat()[:, [3, 0, 1, 2]]
    return found


def _unit(quaternions: Array, section: str) -> Array:
    """Return unit quaternions in the file's order. Raises LogFormatError."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    if not (np.abs(length - 1.0) < 0.05).all():
        k = int(np.argmax(np.abs(length - 1.0)))
        raise LogFormatError(
            f"[{section}] quaternion has the length {length[k, 0]:.3g} in row {k + 1}; "
            "unit quaternions are needed: are these the right columns?"
        )
    quaternions /= length  # in the table of the file, which is large
    return quaternions


def ordered(quaternion: Array, order: str, maps: str) -> Array:
    """Return quaternions as (w, x, y, z), body to world, with continuous signs."""
    found = quaternion[:, ORDERS[order]]
    if maps == "world to body":
        found = conjugate(found)
    make_continuous(found)
    return found
