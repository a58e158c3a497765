"""Detection of a tracker whose poses contradict the inertial sensors.

A left-handed tracker, or one with reversed or permuted axes, looks right at rest, and its poses
turn the vehicle over. They are dropped and count as missing, so that the supervisor reacts as to a
tracker that is silent. What the vehicle can fly with is only reported: a vertical, a scale or
stamps that are off. `estimation.tracker_integrity` says what is compared, and how.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from estimation.tracker_integrity.comparison import compare_pose
from estimation.tracker_integrity.evidence import ALARM, DOUBTED
from estimation.tracker_integrity.felt import note_sample
from estimation.tracker_integrity.memory import OF_TICKS, new_integrity
from estimation.tracker_integrity.slopes import errors
from quadrotor.compiled import direct
from quadrotor.errors import RefusedError
from quadrotor.records import ACTUATORS, IMU_SAMPLE, Record, has_attitude, new_state, pose_sample
from quadrotor.vehicle_model import MODEL
from vehicle import mailbox
from vehicle.modes import Flag
from vehicle.safety.parameters import SafetyParameters

FORGOTTEN_NS = 2_000_000_000
"""Time, in ns, without poses after which they count as those of another tracker."""
BLAMED_NS = 2_000_000_000
"""Time, in ns, for which the IMU is blamed after an alarm was dismissed."""
FITTED_NS = 200_000_000
"""Time, in ns, between two checks of what is only reported."""
AGREEING = 0.8
"""Share of its bound below which an error has gone."""

_AXES = "check that its frame is right-handed, and the axes of world and body"
_TURNS, _MOVES = (
    "the tracker's attitude contradicts the gyroscope",
    "the tracker's position contradicts the accelerometer",
)
_WITNESS = (_TURNS, _TURNS, _MOVES, _MOVES)
"""The contradiction that each test of the tracker shows."""
_JUMPED = "the tracker's attitude jumped, which the gyroscope does not show"
_VERTICAL = (
    "the tracker's frame or the body's axes are tilted, or the accelerometer is not calibrated"
)
GYROSCOPE, ACCELEROMETER, AXIS = "gyroscope", "accelerometer", "gyroscope's axis"
_SUSPICIONS = {
    AXIS: "an axis of the gyroscope is stuck, or beyond its range",
    ACCELEROMETER: "the accelerometer contradicts the tracker and the motors",
}
"""The reasons not to fly on the IMU for long, by what contradicts the others."""
_ALONE = (
    (GYROSCOPE, "the gyroscope's bias has changed: the poses are used; calibrate it on the ground"),
    (
        ACCELEROMETER,
        f"{_SUSPICIONS[ACCELEROMETER]}: the poses are used; calibrate it, or find what shakes it",
    ),
    (AXIS, f"{_SUSPICIONS[AXIS]}: its rate is that of the motors' torques and of the tracker"),
)
"""Faults of the IMU, by the alarm that was dismissed."""
_CONTRADICTED, _TILTED = int(Flag.TRACKER_CONTRADICTED), int(Flag.TRACKER_TILTED)
_SUSPECT = int(Flag.INERTIAL_SUSPECT)


class TrackerIntegrity:
    """Judge of the poses of one vehicle.

    Args:
        parameters: read at each pose.
        say: takes a line for the log and its level.

    Attributes:
        contradiction: why poses count as missing, "" while they do not.
        suspicion: why the IMU is not to be flown on for long, "" while it may.
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(self, parameters: SafetyParameters, say: Callable[[str, int], None]) -> None:
        self._parameters, self._say = parameters, say
        self._memory = new_integrity()
        pose = pose_sample(0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        witnesses = np.zeros(1, IMU_SAMPLE), np.zeros(1, ACTUATORS), np.zeros(1, MODEL)
        self._note = direct(note_sample, self._memory, *witnesses, 0.0)
        self._compare = direct(compare_pose, self._memory, pose, new_state())
        self._errors = direct(errors, self._memory)
        evidence = self._memory["evidence"][0]
        self._of_turns, self._of_moves = evidence[:2], evidence[2:]
        self._overruled = self._memory["overruled"][0]
        self._stuck = self._memory["stuck"][0]
        self._newest_ns = 0
        self.begin()

    def begin(self) -> None:
        """Forget what is known: the vehicle is moved, the gyroscope has no bias yet, or another
        tracker sends.
        """
        self.contradiction, self.suspicion, self.flags = "", "", 0
        self._dismissed, self._blamed_ns = [0, 0, 0], [0, 0, 0]
        self._reported: set[str] = set()
        self._fitted_ns = 0
        if self._memory["stamp_ns"].item() == 0:
            return  # nothing is known
        begun = new_integrity()
        for name in OF_TICKS:
            begun[name] = self._memory[name]
        self._memory[...] = begun

    def note(self, imu: Record, actuators: Record, model: Record, pressure: float) -> None:
        """Store the evidence of a tick: IMU_SAMPLE, ACTUATORS of the last tick, MODEL, (1,) each,
        and the pressure (Pa).
        """
        self._note(self._memory, imu, actuators, model, pressure)

    def takes(self, pose: Record, state: Record, armed: bool) -> bool:
        """Return whether a POSE_SAMPLE (1,) of the vehicle is a measurement.

        Args:
            state: STATE (1,), as estimated.
            armed: otherwise the vehicle may be in a hand, and its accelerometer not calibrated:
                its position begins no contradiction.
        """
        if not has_attitude(pose["quaternion_wb"][0]):
            return True  # of a single marker, without an attitude to compare by
        stamp_ns = pose["stamp_ns"].item()
        if stamp_ns - self._newest_ns > FORGOTTEN_NS:
            self.begin()
        self._newest_ns = stamp_ns
        evidence = self._compare(self._memory, pose, state)
        if not (armed or self.contradiction) and evidence > 0.0:
            self._of_moves[:] = 0.0
            evidence = float(self._of_turns.max())
        if evidence >= ALARM or self.contradiction:
            self._weigh(evidence)
        if self._reported or self._overruled.any() or self._stuck.any():
            self._blame(stamp_ns)
        if evidence >= 0.0 and abs(stamp_ns - self._fitted_ns) > FITTED_NS:
            self._fitted_ns = stamp_ns
            self._report(evidence)
        return not self.contradiction

    def check_arming(self) -> None:
        """Raise RefusedError when the vehicle may not be armed on this tracker."""
        if self.contradiction:
            raise RefusedError(
                f"not armed: {self.contradiction}; {_AXES}, then tilt the vehicle by hand, or "
                "start the tracker again"
            )
        off, most = math.degrees(self._errors(self._memory)[0]), self._parameters.tracker_tilt_max
        if off > most:
            raise RefusedError(
                f"not armed: the vertical of the tracker is {off:.1f}° off that of the "
                f"accelerometer, allowed {most:.1f}°: {_VERTICAL}"
            )

    def _weigh(self, evidence: float) -> None:
        """Change by the largest evidence whether poses count as missing."""
        if not self._parameters.tracker_check:
            self.contradiction = ""
        elif evidence >= ALARM and not self.contradiction:
            tipped = self._memory["tipped"].item() == 1
            self.contradiction = (
                _JUMPED if tipped else _WITNESS[int(self._memory["evidence"][0].argmax())]
            )
            self._say(f"{self.contradiction}: its poses count as missing; {_AXES}", mailbox.ERROR)
        elif evidence == 0.0 and self.contradiction:
            self.contradiction = ""
            self._say("the tracker agrees with the inertial sensors again", mailbox.INFO)
        self._flag()

    def _blame(self, stamp_ns: int) -> None:
        """Report what is wrong with the IMU, while alarms are dismissed."""
        counts = [*self._overruled.tolist(), self._dismissed[2] + self._stuck.any()]
        for which, (instrument, line) in enumerate(_ALONE):
            if counts[which] != self._dismissed[which]:
                self._blamed_ns[which] = stamp_ns
                if instrument not in self._reported:
                    self._reported.add(instrument)
                    self._say(line, mailbox.WARN)
            elif instrument in self._reported and stamp_ns - self._blamed_ns[which] > BLAMED_NS:
                self._reported.discard(instrument)
                self._say(f"the {instrument} agrees with the tracker again", mailbox.INFO)
        self._dismissed = counts
        found = [why for instrument, why in _SUSPICIONS.items() if instrument in self._reported]
        self.suspicion = found[0] if found and self._parameters.tracker_check else ""
        self._flag()

    def _flag(self) -> None:
        tilted = _TILTED if "vertical" in self._reported else 0
        wrong = _CONTRADICTED if self.contradiction else 0
        self.flags = tilted | wrong | (_SUSPECT if self.suspicion else 0)

    def _report(self, evidence: float) -> None:
        """Report errors that the vehicle can fly with."""
        if evidence > DOUBTED or self.contradiction or self.suspicion:
            return  # they may be those of a lie
        p, (tilt, late, size, sure) = self._parameters, self._errors(self._memory)
        tilt, size = math.degrees(tilt), 100.0 * size
        line = f"the vertical of the tracker is {tilt:.1f}° off that of the accelerometer"
        self._tell("vertical", tilt / p.tracker_tilt_told, f"{line}: {_VERTICAL}")
        self._flag()
        share, way = abs(late) / p.tracker_stamps_told, "late" if late > 0 else "early"
        line = f"the tracker's stamps are {1e3 * abs(late):.0f} ms too {way} by the gyroscope"
        self._tell("stamps", share, f"{line}: run the experiment tracker_delay")
        share = min(abs(size) / p.tracker_scale_told, sure)
        way = "large" if size > 0 else "small"
        line = f"the tracker's positions are {abs(size):.0f} % too {way} by the accelerometer"
        self._tell("scale", share, f"{line}: calibrate the tracker, or the accelerometer")

    def _tell(self, what: str, share: float, line: str) -> None:
        """Report an error, given as a share of its bound, once when it appears and once when it has
        gone.
        """
        if share > 1.0 and what not in self._reported:
            self._reported.add(what)
            self._say(line, mailbox.WARN)
        elif share < AGREEING and what in self._reported:
            self._reported.discard(what)
            self._say(f"the tracker's {what}: no error any more", mailbox.INFO)
