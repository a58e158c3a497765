"""Emulated bearings to beacons from poses (paper, Secs. 6.2 and 7), as a camera would give them.

"1.5 deg STD" is read as independent N(0, 1.5°) along each of two tangent axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import Beacons, parse_layout
from bearing_sim.bearing_parameters import BearingParameters, parse_beacon_bias, parse_lost
from bearing_sim.faults.bearings import CATALOGUE, BearingFault
from bearing_sim.faults.fault import Active, Faults, Memory, moved
from bearing_sim.faults.schedule import Moment
from bearing_sim.pose_track import PoseTrack
from bearing_sim.sampling import SECOND_NS, DelayLine, Draws, InstantGrid, hidden, pair
from quadrotor.plain_rotations import Array, Quadruple, Triple, quaternion_of, rows_of

__all__ = ["BearingEmulator", "BearingMeasurement", "BearingParameters", "perturbed"]


class BearingMeasurement(NamedTuple):
    """One frame: stamp (ns), ids (n,), unit vectors (n, 3) in body axes, sigma in rad.

    `beacons` is the set in place when the frame was taken; None if unknown.
    """

    stamp_ns: int
    beacon_ids: npt.NDArray[np.int32]
    bearings_b: Array
    sigma: float
    beacons: Beacons | None = None


class _Layout(NamedTuple):
    """The beacons of a layout text, parsed once."""

    text: str
    beacons: Beacons
    places: tuple[tuple[int, Triple], ...]

    @classmethod
    def of(cls, text: str) -> _Layout:
        """Parse a layout. Raises MeasurementError."""
        beacons = parse_layout(text)
        places = [(x, y, z) for x, y, z in beacons.positions_w.tolist()]
        return cls(text, beacons, tuple(zip(beacons.ids.tolist(), places, strict=True)))


class BearingEmulator:
    """Emulator of the bearing sensor: `observe` feeds poses, `due` returns frames, maybe empty.

    Frames are taken at k/rate on the clock of the stamps, whatever the poses' own stamps: the pose
    at that instant is interpolated once the first pose at or after it has arrived. There are no
    frames in a gap of the poses (PoseTrack). Only range, field of view, spells and `lost` hide a
    beacon: neither the ground nor the vehicle's frame does.

    `parameters` may be changed between calls.
    """

    def __init__(self, parameters: BearingParameters) -> None:
        self.parameters = parameters
        self._layout = _Layout.of(parameters.layout)
        self._grid = InstantGrid()
        self._track = PoseTrack()
        self._line: DelayLine[BearingMeasurement] = DelayLine()
        self._faults = Faults(CATALOGUE)

    @property
    def beacons(self) -> Beacons:
        """Return the set that `parameters.layout` describes; thread-safe."""
        return self._present_layout().beacons

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Observe the pose at `stamp_ns`: (3,) m, (4,) unit quaternion body to world.

        A pose that is not newer than the newest is ignored; one more than 0.1 s older restarts the
        emulator.
        """
        if self._track.went_back(stamp_ns):
            self._track, self._line = PoseTrack(), DelayLine()
        after_ns = self._track.add(stamp_ns, position_w, quaternion_wb)
        if after_ns is None:
            return
        for instant_ns in self._grid.between(after_ns, stamp_ns, self.parameters.rate):
            pose = self._track.at(instant_ns)
            self._take(instant_ns, pose.position_w, pose.quaternion_wb)

    def due(self, now_ns: int) -> list[BearingMeasurement]:
        """Return the frames that have arrived by `now_ns`, each once, in order."""
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        """Return the arrival time of the next frame in transit; None when there is none."""
        return self._line.next_ns

    def _take(self, stamp_ns: int, position_w: Triple, quaternion_wb: Quadruple) -> None:
        layout, active = self._present_layout(), self._active(stamp_ns)
        p = moved(self.parameters, active)
        places = self._places(stamp_ns, position_w)
        frame_draws = Draws(p.seed, stamp_ns)
        late = p.delay + p.jitter * (1.0 - frame_draws.uniform())
        ids = _identities([id for id, _ in places], p.swap, frame_draws)
        for fault, moment, _ in _of_bearings(active):
            places, ids = fault.moves(places, moment), fault.names(ids, moment)
        lost = parse_lost(p.lost)
        sigma = math.radians(p.sigma)
        freedom = math.inf if p.distribution == "gaussian" else p.degrees_of_freedom
        spell_ns = round(p.occlusion_spell * SECOND_NS)
        axis, lowest = axis_of(p), _lowest_cosine(p)
        biased = _bias_of(p)
        own_biases = parse_beacon_bias(p.beacon_bias) if p.beacon_bias else {}

        # Read once: an attribute of parameters takes as long as three multiplications.
        nearest, farthest, occlusion, drop_out = p.range_min, p.range_max, p.occlusion, p.drop_out
        x, y, z = position_w
        (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = rows_of(quaternion_wb)
        seen_ids: list[int] = []
        seen: list[Triple] = []
        # Plain floats: for four beacons, numpy's calls cost more than the arithmetic.
        for claimed_id, (id, (px, py, pz)) in zip(ids, places, strict=True):
            u, v, w = px - x, py - y, pz - z
            distance = math.sqrt(u * u + v * v + w * w)
            if lost is None or id in lost or not nearest <= distance <= farthest:
                continue
            if hidden(p.seed, id, stamp_ns, occlusion, spell_ns):
                continue
            draws = Draws(id, of=frame_draws)
            if draws.uniform() <= drop_out:
                continue
            bearing_b = (
                (r00 * u + r10 * v + r20 * w) / distance,
                (r01 * u + r11 * v + r21 * w) / distance,
                (r02 * u + r12 * v + r22 * w) / distance,
            )
            if _along(axis, bearing_b) < lowest:
                continue
            if active:
                bearing_b = _bent(bearing_b, axis, id, stamp_ns, draws, active)
            if biased is not None:
                bearing_b = _product(biased, bearing_b)
            if id in own_biases:
                bearing_b = _product(_turn_of(own_biases[id]), bearing_b)
            along, across = pair(draws, freedom)
            seen_ids.append(claimed_id)
            seen.append(perturbed(bearing_b, sigma * along, sigma * across))
        bearings = np.array(seen_ids, np.int32), np.array(seen, np.float64).reshape(-1, 3)
        own_ns = stamp_ns + round(p.stamp_error * SECOND_NS)
        frame = BearingMeasurement(own_ns, *bearings, sigma, layout.beacons)
        self._line.put(stamp_ns + round(late * SECOND_NS), frame)

    def _places(self, stamp_ns: int, position_w: Triple) -> list[tuple[int, Triple]]:
        """Return id and place of what is seen from `position_w`; the beacons stand still."""
        return [*self._present_layout().places]

    def _active(self, stamp_ns: int) -> Sequence[Active]:
        """Return the faults that are on."""
        p, faults = self.parameters, self._faults
        if p.faults != faults.text:
            faults.set(p.faults, p, stamp_ns)
        return faults.active(stamp_ns, p.seed) if faults else ()

    def _present_layout(self) -> _Layout:
        layout, text = self._layout, self.parameters.layout
        if text != layout.text:
            self._layout = layout = _Layout.of(text)
        return layout


def _of_bearings(active: Sequence[Active]) -> Iterator[tuple[BearingFault, Moment, Memory]]:
    for one in active:
        if isinstance(one.fault, BearingFault):
            yield one.fault, one.moment, one.memory


def _bent(
    bearing_b: Triple,
    axis_b: Triple,
    id: int,
    stamp_ns: int,
    draws: Draws,
    active: Sequence[Active],
) -> Triple:
    """Return the bearing of a beacon with the faults that are on."""
    for k, (fault, moment, memory) in enumerate(_of_bearings(active)):
        own = memory.setdefault(id, {})
        own["frame_ns"] = stamp_ns
        bearing_b = fault.bends(bearing_b, axis_b, Draws(k, of=draws), moment, own)
    return bearing_b


def _identities(ids: list[int], swap: float, draws: Draws) -> list[int]:
    """Return the reported ids: in a share `swap` of the frames, two of them are exchanged."""
    if swap <= 0.0:
        return ids
    swapped, first, second = (1.0 - draws.uniform() for _ in range(3))
    if swapped < swap:
        one = int(first * len(ids))
        other = (one + 1 + int(second * (len(ids) - 1))) % len(ids)
        ids[one], ids[other] = ids[other], ids[one]
    return ids


def axis_of(p: BearingParameters) -> Triple:
    """Return the sensor's axis in body axes: -z of axes rotated by roll, pitch and yaw (ZYX)."""
    if p.mount_roll == p.mount_pitch == p.mount_yaw == 0.0:
        return 0.0, 0.0, -1.0
    roll, pitch, yaw = (math.radians(a) for a in (p.mount_roll, p.mount_pitch, p.mount_yaw))
    away = math.cos(roll) * math.sin(pitch)
    return (
        -(math.cos(yaw) * away + math.sin(yaw) * math.sin(roll)),
        -(math.sin(yaw) * away - math.cos(yaw) * math.sin(roll)),
        -math.cos(roll) * math.cos(pitch),
    )


def _lowest_cosine(p: BearingParameters) -> float:
    """Return the cosine of the largest angle to the axis at which a beacon is seen."""
    return math.cos(math.radians(0.5 * p.field_of_view)) if p.field_of_view < 360.0 else -2.0


def _bias_of(p: BearingParameters) -> tuple[Triple, Triple, Triple] | None:
    """Return the rows of the constant rotation of all bearings; None for no bias."""
    if p.bias_x == p.bias_y == p.bias_z == 0.0:
        return None
    return _turn_of((p.bias_x, p.bias_y, p.bias_z))


def _turn_of(vector_deg: Triple) -> tuple[Triple, Triple, Triple]:
    """Return the rows of the rotation by a rotation vector, deg."""
    x, y, z = (math.radians(a) for a in vector_deg)
    return rows_of(quaternion_of(x, y, z))


def _along(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _product(rows: tuple[Triple, Triple, Triple], v: Triple) -> Triple:
    return _along(rows[0], v), _along(rows[1], v), _along(rows[2], v)


def perturbed(bearing: Triple, along: float, across: float) -> Triple:
    """Return a unit vector moved on the sphere by two angles (rad), along two tangent axes."""
    x, y, z = bearing
    # Two tangents without a square root, well conditioned everywhere (Duff et al., JCGT 2017).
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    angle = math.sqrt(along * along + across * across)
    share = math.sin(angle) / max(angle, 1e-300)
    cosine, along, across = math.cos(angle), share * along, share * across
    return (
        cosine * x + along * (1.0 + sign * x * x * a) + across * b,
        cosine * y + along * sign * b + across * (sign + y * y * a),
        cosine * z - along * sign * x - across * y,
    )
