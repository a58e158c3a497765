"""Faults of the simulated tracking system, on the poses that it measures."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bearing_sim.faults.fault import Active, Catalogue, Fault, Memory
from bearing_sim.faults.schedule import Moment
from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.sampling import SECOND_NS
from quadrotor.parameters import parameter
from quadrotor.plain_rotations import Array, product_of, quaternion_of, rotate
from quadrotor.records import has_attitude

ASSUMED = "assumed"
"""Source of physics that is a definition, without a figure from elsewhere."""
QUARTER = math.sqrt(0.5)


class TrackerFault(Fault):
    """Base of the tracker's faults."""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        """Return the pose with the fault."""
        raise NotImplementedError

    def deliver(
        self, pose: PoseMeasurement, moment: Moment, memory: Memory
    ) -> Sequence[PoseMeasurement]:
        """Return the poses that are sent for this one."""
        return (self.act(pose, moment, memory),)


class Freeze(TrackerFault):
    """The first pose of the fault is repeated with new stamps, as by a solver that has lost its
    markers and goes on sending.
    """

    name = "tracker.freeze"
    source = "frozen rigid bodies of motion capture software; definition"

    what: str = parameter("pose", choices=("pose", "position", "attitude"))
    """part that stays"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        _, position_w, quaternion_wb = memory.setdefault("pose", pose)
        if self.what != "attitude":
            pose = pose._replace(position_w=position_w)
        return pose if self.what == "position" else pose._replace(quaternion_wb=quaternion_wb)


class Drift(TrackerFault):
    """The origin moves away at a constant speed, as when a camera slips."""

    name = "tracker.drift"
    source = ASSUMED
    varies = True

    x: float = parameter(0.01, unit="m/s", ge=-1, le=1, step=0.005)
    """speed along x_W"""
    y: float = parameter(0.0, unit="m/s", ge=-1, le=1, step=0.005)
    """speed along y_W"""
    z: float = parameter(0.0, unit="m/s", ge=-1, le=1, step=0.005)
    """speed along z_W"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        way = moment.level * moment.elapsed
        moved = (way * self.x, way * self.y, way * self.z)
        return pose._replace(position_w=pose.position_w + moved)


class Tilt(TrackerFault):
    """The world axes of the system are turned about its origin, as by a floor plane that was set
    on a slope.
    """

    name = "tracker.tilt"
    source = ASSUMED

    x: float = parameter(2.0, unit="°", ge=-45, le=45, step=0.5)
    """rotation vector along x_W"""
    y: float = parameter(0.0, unit="°", ge=-45, le=45, step=0.5)
    """rotation vector along y_W"""
    z: float = parameter(0.0, unit="°", ge=-180, le=180, step=0.5)
    """rotation vector along z_W"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        x, y, z = (moment.level * math.radians(one) for one in (self.x, self.y, self.z))
        return _turned_world(pose, np.array(quaternion_of(x, y, z)))


class Scale(TrackerFault):
    """Distances are wrong by a factor, as after a calibration with a wand of another length."""

    name = "tracker.scale"
    source = ASSUMED

    factor: float = parameter(1.05, ge=0.1, le=10, step=0.01)
    """measured over true distance from the origin"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        factor = 1.0 + moment.level * (self.factor - 1.0)
        return pose._replace(position_w=factor * pose.position_w)


class Handedness(TrackerFault):
    """The world is mirrored along an axis: poses are given in left-handed axes."""

    name = "tracker.handedness"
    source = "M R M with a reflection M; definition"

    axis: str = parameter("x", choices=("x", "y", "z"))
    """axis of the world that is mirrored"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        sign = np.ones(3)
        sign["xyz".index(self.axis)] = -1.0
        quaternion = pose.quaternion_wb.copy()
        quaternion[1:] *= -sign
        return pose._replace(position_w=sign * pose.position_w, quaternion_wb=quaternion)


class Axes(TrackerFault):
    """The axes differ from the agreed ones: y points up, or they are turned by 90° about the
    vertical.
    """

    name = "tracker.axes"
    source = "conventions of motion capture systems; definition"

    which: str = parameter("y_up", choices=("y_up", "world_quarter", "body_quarter"))
    """y up in the world and in the body, or the world's or the body's axes turned by 90° about z"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        if self.which == "y_up":
            (x, y, z), (w, a, b, c) = pose.position_w, pose.quaternion_wb
            return pose._replace(
                position_w=np.array((x, z, -y)), quaternion_wb=np.array((w, a, c, -b))
            )
        quarter = np.array((QUARTER, 0.0, 0.0, QUARTER))
        if self.which == "world_quarter":
            return _turned_world(pose, quarter)
        quaternion = product_of(pose.quaternion_wb[None], quarter[None])[0]
        return pose._replace(quaternion_wb=quaternion)


class SwappedBodies(TrackerFault):
    """The poses belong to another body, which lies level at a fixed place, but carry this body's
    name.
    """

    name = "tracker.swapped_bodies"
    source = "mislabelled rigid bodies of motion capture software; definition"

    x: float = parameter(1.5, unit="m", ge=-20, le=20, step=0.1)
    """place of the other body along x_W"""
    y: float = parameter(-1.0, unit="m", ge=-20, le=20, step=0.1)
    """place of the other body along y_W"""
    z: float = parameter(0.8, unit="m", ge=-5, le=20, step=0.1)
    """place of the other body along z_W"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        pose = pose._replace(position_w=np.array((self.x, self.y, self.z)))
        if not has_attitude(pose.quaternion_wb):
            return pose
        return pose._replace(quaternion_wb=np.array((1.0, 0.0, 0.0, 0.0)))


class Clock(TrackerFault):
    """The clock of the stamps is set to another time, and runs faster or slower."""

    name = "tracker.clock"
    source = "quartz oscillators: 20 to 100 ppm; a step by a time server: assumed"
    varies = True

    step: float = parameter(0.0, unit="s", ge=-10, le=10, step=0.01)
    """by which the stamps are late, at once"""
    drift: float = parameter(0.0, unit="ppm", ge=-100000, le=100000, step=10)
    """by which the clock is too fast"""

    def act(self, pose: PoseMeasurement, moment: Moment, memory: Memory) -> PoseMeasurement:
        off = moment.level * (self.step + 1e-6 * self.drift * moment.elapsed)
        return pose._replace(stamp_ns=pose.stamp_ns + round(SECOND_NS * off))


class Duplicates(TrackerFault):
    """Each pose is sent several times, as by a network with two paths."""

    name = "tracker.duplicates"
    source = "UDP, RFC 768: datagrams may be duplicated"

    copies: int = parameter(2, ge=2, le=5, step=1)
    """number of times that each pose is sent"""

    def deliver(
        self, pose: PoseMeasurement, moment: Moment, memory: Memory
    ) -> Sequence[PoseMeasurement]:
        return (pose,) * self.copies


class Order(TrackerFault):
    """Every other pose arrives after the one that follows it; the last one held back is lost."""

    name = "tracker.order"
    source = "UDP, RFC 768: datagrams may arrive out of order"

    def deliver(
        self, pose: PoseMeasurement, moment: Moment, memory: Memory
    ) -> Sequence[PoseMeasurement]:
        held = memory.pop("held", None)
        if held is None:
            memory["held"] = pose
            return ()
        return pose, held


def _turned_world(pose: PoseMeasurement, turn: Array) -> PoseMeasurement:
    """Return the pose in axes that are turned by a unit quaternion about the origin."""
    quaternion = product_of(turn[None], pose.quaternion_wb[None])[0]
    return pose._replace(
        position_w=np.array(rotate(turn, pose.position_w)), quaternion_wb=quaternion
    )


TRACKER: tuple[type[TrackerFault], ...] = (
    *(Freeze, Drift, Tilt, Scale, Handedness, Axes, SwappedBodies, Clock, Duplicates, Order),
)
CATALOGUE = Catalogue("tracker.faults", {one.name: one for one in TRACKER})


def delivered(pose: PoseMeasurement, active: Sequence[Active]) -> list[PoseMeasurement]:
    """Return the poses that are sent for a measured one, with the faults that are on."""
    poses = [pose]
    for one in active:
        if isinstance(one.fault, TrackerFault):
            fault = one.fault
            poses = [sent for each in poses for sent in fault.deliver(each, one.moment, one.memory)]
    return poses
