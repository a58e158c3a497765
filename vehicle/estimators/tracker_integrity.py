"""Detection of a tracker whose poses contradict the inertial sensors.

A left-handed tracker, or one with reversed or permuted axes, looks right at rest, and its poses
turn the vehicle over. They are dropped and count as missing, so that the supervisor reacts as to a
tracker that is silent. `estimation.tracker_integrity` says what is compared, and how.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from estimation.tracker_integrity import (
    KNOWN,
    compare_pose,
    new_integrity,
    note_sample,
    vertical_error,
)
from quadrotor.compiled import direct
from quadrotor.errors import RefusedError
from quadrotor.records import IMU_SAMPLE, Record, has_attitude, new_state, pose_sample
from vehicle.flight.modes import Flag
from vehicle.processes import mailbox
from vehicle.safety.parameters import SafetyParameters

ALARM = 15.0
"""Evidence with which the poses count as missing; without any they are used again."""
FORGOTTEN_NS = 2_000_000_000
"""Time, in ns, without poses after which they count as those of another tracker."""
AGREEING = 0.8
"""Share of the bound below which the verticals agree again."""

_AXES = "check that its frame is right-handed, and the axes of world and body"
_PROVE = "tilt the vehicle by hand, or start the tracker again"
_TURNS, _MOVES = (
    "the tracker's attitude contradicts the gyroscope",
    "the tracker's position contradicts the accelerometer",
)
_WITNESS = (_TURNS, _TURNS, _MOVES, _MOVES)
"""What contradicts what, by the test."""
_LIES, _TILTED = int(Flag.TRACKER_CONTRADICTED), int(Flag.TRACKER_TILTED)


class TrackerIntegrity:
    """Judge of the poses of one vehicle.

    Args:
        parameters: read at each pose.
        say: takes a line for the log and its level.

    Attributes:
        contradiction: why poses count as missing, "" while they do not.
        flags: bits of vehicle.flight.modes.Flag.
    """

    def __init__(self, parameters: SafetyParameters, say: Callable[[str, int], None]) -> None:
        self._parameters, self._say = parameters, say
        self._memory = new_integrity()
        pose = pose_sample(0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        self._note = direct(note_sample, self._memory, np.zeros(1, IMU_SAMPLE))
        self._compare = direct(compare_pose, self._memory, pose, new_state())
        self._evidence = self._memory["evidence"][0]
        self._learnt = self._memory["learnt"]
        self._newest_ns = 0
        self.contradiction, self.flags = "", 0

    def begin(self) -> None:
        """Forget the evidence: the vehicle was moved, the sensors calibrated, or another tracker
        sends.
        """
        self._memory["stamp_ns"] = 0
        self._evidence[:] = 0.0
        self._learnt[:] = 0.0
        self.contradiction, self.flags = "", 0

    def note(self, imu: Record) -> None:
        """Store the IMU_SAMPLE (1,) of a tick."""
        self._note(self._memory, imu)

    def takes(self, pose: Record, state: Record) -> bool:
        """Return whether a POSE_SAMPLE (1,) of the vehicle is a measurement.

        Args:
            state: STATE (1,), as estimated.
        """
        if not has_attitude(pose["quaternion_wb"][0]):
            return True  # of a single marker, without an attitude to compare by
        stamp_ns = pose["stamp_ns"].item()
        if stamp_ns - self._newest_ns > FORGOTTEN_NS:
            self.begin()
        self._newest_ns = stamp_ns
        if self._compare(self._memory, pose, state):
            self._weigh()
        return not self.contradiction

    def check_arming(self) -> None:
        """Raise RefusedError when the vehicle may not be armed on this tracker."""
        if self.contradiction:
            raise RefusedError(f"not armed: {self.contradiction}; {_AXES}, then {_PROVE}")
        off, most = self._off(), self._parameters.tracker_tilt_max
        if off > most:
            raise RefusedError(
                f"not armed: the vertical of the tracker is {off:.1f} deg off that of the "
                f"accelerometer, allowed {most:.1f} deg; level the tracker's frame and the body's "
                "axes in it, or calibrate the accelerometer"
            )

    def _off(self) -> float:
        """Return the angle between the verticals, in deg, 0 while it is not known."""
        if self._learnt.item() < KNOWN:
            return 0.0
        return math.degrees(vertical_error(self._memory))

    def _weigh(self) -> None:
        """Set flags by the evidence, and report what is new."""
        p = self._parameters
        most = float(self._evidence.max())
        if not p.tracker_check:
            self.contradiction = ""
        elif most >= ALARM and not self.contradiction:
            self.contradiction = _WITNESS[int(self._evidence.argmax())]
            line = f"{self.contradiction}: its poses count as missing; {_AXES}"
            self._say(line, mailbox.ERROR)
        elif most == 0.0 and self.contradiction:
            self.contradiction = ""
            self._say("the tracker agrees with the inertial sensors again", mailbox.INFO)
        off, was = self._off(), self.flags & _TILTED
        tilted = off > p.tracker_tilt_told * (AGREEING if was else 1.0)
        self.flags = (_LIES if self.contradiction else 0) | (_TILTED if tilted else 0)
        if tilted and not was:
            self._say(
                f"the vertical of the tracker is {off:.1f} deg off that of the accelerometer: the "
                "tracker's frame or the body's axes in it are tilted, or the accelerometer is not "
                "calibrated",
                mailbox.WARN,
            )
        elif was and not tilted:
            self._say("the verticals of tracker and accelerometer agree again", mailbox.INFO)
