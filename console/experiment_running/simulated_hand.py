"""The simulator's hand and bench, for procedures carried out by a person on a real vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence

from quadrotor.errors import (
    LinkError,
    MeasurementError,
    NoAnswerError,
    RefusedError,
    UnreachableError,
    WrongTypeError,
)
from quadrotor.parameter_description import ParameterValue
from quadrotor.plain_rotations import roll_pitch_yaw
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_value, to_parameters
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.node import Node

HELD, FREE = "simulator.held", "free"
ANGLES = ("simulator.hand_roll", "simulator.hand_pitch", "simulator.hand_yaw")
TIMEOUT = 1.0
_GET = "rcl_interfaces/srv/GetParameters"


class SimulatedHand:
    """The hand of the connected simulator, if there is one; used by one experiment at a time.

    Attributes:
        is_there: whether a simulator answered when the experiment began.
    """

    def __init__(self, node: Node, vehicle: str) -> None:
        self._get = node.client(f"/{vehicle}/simulator/get_parameters", _GET)
        self._change = node.client("simulator/change_parameters", SERVICES["change_parameters"])
        self.is_there = False
        self._held = FREE

    def begin(self, requester: str) -> None:
        """Begin an experiment: check for a simulator, and release a vehicle that is still held.
        Raises RefusedError.
        """
        held = self._asked()
        self.is_there, self._held = held is not None, held or FREE
        self.let_go(requester)

    def turn(self, quaternion_wb: Sequence[float] | None, requester: str) -> None:
        """Hold the vehicle in this attitude (w, x, y, z), or release it for None; no effect on a
        real one.

        Raises MeasurementError for an invalid attitude, RefusedError with the simulator's reason.
        """
        if quaternion_wb is None:
            self.let_go(requester)
            return
        angles = euler_degrees(quaternion_wb)
        if self.is_there:
            self._hold("hand", dict(zip(ANGLES, angles, strict=True)), requester)

    def fix(self, requester: str) -> None:
        """Fix the vehicle to the bench; no effect on a real one. Raises RefusedError."""
        if self.is_there and self._held != "bench":
            self._hold("bench", {}, requester)

    def let_go(self, requester: str) -> None:
        """Release the vehicle. Raises RefusedError."""
        if self._held != FREE:
            self._hold(FREE, {}, requester)

    def _asked(self) -> str | None:
        """Return how the vehicle is held now; None without a simulator, or when it
        cannot hold it.
        """
        request = new("rcl_interfaces/srv/GetParameters_Request", names=[HELD])
        for _ in range(2):  # one retry for a busy computer
            try:
                [value] = self._get.call(request, TIMEOUT).values
                return str(from_value(value))
            except UnreachableError:
                return None
            except NoAnswerError:
                continue
            except (LinkError, WrongTypeError, ValueError):
                return None
        return None

    def _hold(self, how: str, angles: dict[str, float], requester: str) -> None:
        values: dict[str, ParameterValue] = {HELD: how, **angles}
        try:
            self._change.ask(requester, timeout=TIMEOUT, parameters=to_parameters(values))
        except (LinkError, RefusedError) as error:
            raise RefusedError(f"the simulator does not hold the vehicle: {error}") from error
        self._held = how


def euler_degrees(quaternion_wb: Sequence[float]) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (deg, ZYX). Raises MeasurementError unless it is a unit
    quaternion.
    """
    try:
        w, x, y, z = (float(part) for part in quaternion_wb)
        length = math.hypot(w, x, y, z)
    except (TypeError, ValueError):
        length = math.nan
    if not abs(length - 1.0) < 1e-3:
        raise MeasurementError(
            f"an attitude is a unit quaternion (w, x, y, z), not {quaternion_wb!r:.80}"
        )
    roll, pitch, yaw = roll_pitch_yaw(w / length, x / length, y / length, z / length)
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)
