"""Bench tests of one motor: which requests are allowed, and when a test stops by itself.

They identify a motor (Sec. 5.3 of the paper) with propellers off or the vehicle fixed. The request
must be repeated: when the requester disappears, the motor stops.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.constants import MOTORS
from quadrotor.errors import RefusedError
from quadrotor.motor_state import MotorState
from vehicle.boards.board import RawSample
from vehicle.safety.parameters import SafetyParameters

REFERENCE_MAX = 200
"""Largest reference, in counts; the bench test's last step is 190, the wire allows 255."""
TURN_TIME = 1.0
"""s, time constant of the measured turn: drift and vibration decay, a tumble remains."""


def check_bench(motor: int, reference: int) -> None:
    """Raise RefusedError when the motor or the reference is not allowed."""
    if not 1 <= motor <= len(MOTORS):
        known = ", ".join(f"{k} {name}" for k, name in enumerate(MOTORS, 1))
        raise RefusedError(f"bench refused: there is no motor {motor}: {known}; 0 ends the bench")
    if not 0 <= reference <= REFERENCE_MAX:
        raise RefusedError(
            f"bench refused: reference {reference} is out of bounds; allowed 0 to {REFERENCE_MAX} "
            "counts"
        )


class Bench:
    """The motor on the bench.

    Args:
        impossible: why the board cannot turn a single motor; "" when it can.

    Attributes:
        motor: 1…4, 0 when none is on the bench.
        reference: counts.
    """

    def __init__(self, safety: SafetyParameters, impossible: str = "") -> None:
        self._safety, self.impossible = safety, impossible
        self._turn_b = np.zeros(3)  # rad
        self.motor = self.reference = self._asked_ns = 0
        self._started = False

    def __str__(self) -> str:
        return f"motor {self.motor} ({MOTORS[self.motor - 1]})"

    @property
    def references(self) -> tuple[int, int, int, int]:
        """Return the references of all motors; 0 for motors that are not on the bench."""
        one, two, three, four = (self.reference if self.motor == k else 0 for k in range(1, 5))
        return one, two, three, four

    def turn(self, motor: int, reference: int, stamp_ns: int) -> None:
        """Run a motor for `safety.bench_timeout` from now; the caller has called `check_bench`."""
        if self.motor and motor != self.motor:
            raise RefusedError(f"bench refused: {self} is on the bench; end that (motor 0) first")
        self.motor, self.reference, self._asked_ns = motor, reference, stamp_ns

    def end(self) -> None:
        """End the bench test."""
        self.motor = self.reference = self._asked_ns = 0
        self._started = False
        self._turn_b[:] = 0.0

    def fault(
        self, sample: RawSample, battery_spent: bool, motors_had_time: bool, obstacle: str
    ) -> str:
        """Return why the battery or the microcontroller forbids turning motors; "" if they do not.

        Args:
            motors_had_time: whether the motors have had time to start.
            obstacle: why the microcontroller would not start them, "" when it would.
        """
        if battery_spent:
            return f"battery at {sample.battery_voltage:.1f} V"
        if sample.motor_state == MotorState.EMERGENCY:
            return "the microcontroller's emergency: commands were missing, or the battery is low"
        if sample.motor_state == MotorState.ON:
            self._started = True
        elif self._started or motors_had_time:
            name = MotorState(sample.motor_state).name.lower()
            return obstacle or f"the microcontroller reports motors {name}"
        return ""

    def over(self, stamp_ns: int, angular_velocity_b: npt.NDArray[np.float64], dt: float) -> str:
        """Return why the motor has to stop now, or "" when it may continue; called once per tick.

        Args:
            angular_velocity_b: (3,) rad/s.
        """
        timeout = self._safety.bench_timeout
        if (stamp_ns - self._asked_ns) * 1e-9 > timeout:
            return f"not requested again within {timeout:g} s"
        self._turn_b += angular_velocity_b * dt - self._turn_b * min(1.0, dt / TURN_TIME)
        x, y, z = self._turn_b.tolist()
        turned, most = math.degrees(math.sqrt(x * x + y * y + z * z)), self._safety.bench_turn_max
        if turned > most:
            return f"the vehicle turned by {turned:.0f}°, allowed {most:g}; fix it"
        return ""
