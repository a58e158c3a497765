"""The identity of a microcontroller, which the vehicle checks before motors may start."""

from __future__ import annotations

import msgspec

from quadrotor.errors import UsageError

LARGEST = 32767


class Identity(msgspec.Struct, frozen=True):
    """The identity that the microcontroller must report as ROBOT_ID and FIRMWARE_REVISION."""

    robot_id: int = 1
    firmware: int = 1

    def __str__(self) -> str:
        return f"robot {self.robot_id} with firmware {self.firmware}"

    def check(self) -> None:
        """Raise UsageError when no microcontroller can have this identity."""
        for option, value in (("--robot-id", self.robot_id), ("--firmware", self.firmware)):
            if not 0 <= value <= LARGEST:
                raise UsageError(f"{option} {value} is not allowed; allowed are 0 to {LARGEST}")


THE_ONE = Identity()
"""The robot and the firmware that quadlab was made with."""
