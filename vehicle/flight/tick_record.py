"""The output of one tick of the flight stack: its record, with views, and its messages."""

from __future__ import annotations

import numpy as np

from control.behaviors.ground import rest_reference
from quadrotor.plain_rotations import tilt_of
from quadrotor.records import ACTUATORS, Record, new_tick
from vehicle import mailbox
from vehicle_link.commands import BRAKING, EventKind

LONGEST_GAP = 1.0
"""Longest time, in s, that estimators predict: beyond it the motion is unknown, and a stamp that
jumps must not destroy the estimate."""
NOMINAL_STEP = 0.002


class TickRecord:
    """One TICK record and its fields.

    The views are made once: looking up fields by name in each tick costs as much as the laws.

    Attributes:
        stamp_ns: time of the newest sample, ns of the vehicle's clock.
        record: TICK (1,); imu, state, reference, actuators, estimate and status are its fields.
        specific_force_b: (3,) m/s², measured by the IMU.
        position_w: (3,) m, of the estimated state.
        agreement: (1,), a number of `estimation.outcome.Agreement`.
        motor_references: (4,) counts, commanded by the control law.
        wrench: (4,) N and N m.
        scaling: (1,), below 1 while the motors saturate.
    """

    def __init__(self) -> None:
        self.stamp_ns = 0
        self.record: Record = new_tick()
        self.imu = self.record["imu"]
        self.state = self.record["state"]
        self.reference = self.record["reference"]
        self.actuators = self.record["actuators"]
        self.estimate = self.record["estimate"]
        self.status = self.record["status"]
        self.specific_force_b = self.imu["specific_force_b"][0]
        self.angular_velocity_b = self.imu["angular_velocity_b"][0]
        self.position_w = self.state["position_w"][0]
        self.agreement = self.estimate["agreement"]
        self.motor_references = self.actuators["motor_references"][0]
        self.wrench = self.actuators["wrench"][0]
        self.scaling = self.actuators["scaling"]
        self._quaternion_wb = self.state["quaternion_wb"][0]
        self._sequence = self.record["sequence"]
        self._motors_off = np.zeros(1, ACTUATORS)
        self._motors_off["scaling"] = 1.0

    @property
    def tilt(self) -> float:
        """Return the angle (rad) between z_B and z_W."""
        return tilt_of(*self._quaternion_wb.tolist())

    @property
    def vertical_force(self) -> float:
        """Return the specific force along z_W in m/s², by the estimated attitude."""
        w, x, y, z = self._quaternion_wb.tolist()
        a, b, c = self.specific_force_b.tolist()
        across, along = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)
        return float(across * a + along * b + (1.0 - 2.0 * (x * x + y * y)) * c)

    @property
    def saturated(self) -> bool:
        """Return whether the motors could not produce the wrench commanded by the control law."""
        return bool(self.scaling.item() < 1.0)

    def begin(self, stamp_ns: int) -> float:
        """Begin a tick and return the time (s) since the last one.

        Returns 0 for a sample that is not newer, which does not begin a tick.
        """
        since = (stamp_ns - self.stamp_ns) * 1e-9 if self.stamp_ns else NOMINAL_STEP
        if since <= 0.0:
            return 0.0
        self.stamp_ns = stamp_ns
        self._sequence[0] = self._sequence.item() + 1
        return min(since, LONGEST_GAP)

    def motors_off(self) -> None:
        """Write that no motor is commanded."""
        self.actuators[...] = self._motors_off

    def rest(self) -> None:
        """Write a tick on the ground: no motor is commanded, the reference follows the state."""
        rest_reference(self.state, self.reference)
        self.motors_off()


class Outbox:
    """Messages of one flight stack, collected by its caller between two ticks.

    Attributes:
        messages: oldest first; the caller empties the list.
    """

    def __init__(self, tick: TickRecord) -> None:
        self._tick = tick
        self.messages: list[mailbox.Notification] = []

    def add(self, message: mailbox.Notification) -> None:
        """Add a message."""
        self.messages.append(message)

    def say(self, text: str, level: int = mailbox.INFO, *kinds: EventKind) -> None:
        """Add a line for the log and the page, with the time of the newest tick."""
        self.add(mailbox.Event(self._tick.stamp_ns, level, text, frozenset(kinds)))

    def say_braking(self, why: str) -> None:
        """Tell that the vehicle brakes by its own decision."""
        self.say(f"{BRAKING}{why}", mailbox.WARN, EventKind.BRAKING)
