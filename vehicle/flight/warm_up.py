"""Compile every law before the first sample is used.

A temporary stack flies one short hop through all behaviors, which calls everything the tick may
call once, with the argument types used in flight. From numba's cache this takes 0.2 s.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from control.behaviors.table import BehaviorName
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import pose_sample
from vehicle import mailbox
from vehicle.boards.board import RawSample
from vehicle.flight.stack import FlightStack
from vehicle.modes import Mode
from vehicle.parameters import new_parameters

PERIOD_NS = 10_000_000  # at fewer ticks a second the hop takes less of the start
STILL = 512  # counts of a sensor at zero
ONE_G = 256  # counts
TREMBLE = 1e-9  # m and rad: poses that do not change at all are none
A_FEW_TICKS = 50
LONGEST = 10_000  # ticks

HOP: tuple[tuple[str, dict[str, ParameterValue], bool], ...] = (  # last: wait for hover
    ("take_off", {"height": 0.6}, True),
    ("fly_to", {"x": 0.2, "y": 0.1, "z": 0.7, "yaw": 0.2}, False),
    ("brake", {}, True),
    ("follow_trajectory", {}, False),
    ("brake", {}, True),
    ("velocity", {}, False),
    ("hover", {}, True),
    ("land", {}, False),
)


class _Hop:
    """A vehicle that always follows its reference exactly."""

    def __init__(self) -> None:
        parameters = new_parameters()
        parameters.safety.gyro_samples = 50
        parameters.safety.tracker_check = False  # the IMU stays at rest
        self.stack = FlightStack(parameters)
        self._stamp_ns = 0
        self._ticks = 0

    def tick(self) -> None:
        self._ticks += 1
        self._stamp_ns += PERIOD_NS
        stack = self.stack
        stack.measure(mailbox.Heartbeat(self._stamp_ns))
        stack.measure(mailbox.Joy(self._stamp_ns, (0.1, 0.0, 0.0, 0.1), True))
        x, y, z = stack.reference["position_w"][0].tolist()
        tremble = TREMBLE * (self._ticks % 2)
        pose = pose_sample(self._stamp_ns, (x + tremble, y, z), (1.0, tremble, 0.0, 0.0))
        stack.measure(pose)
        acceleration = (STILL, STILL, STILL + ONE_G)
        motors = stack.modes.motor_state_wanted
        stack.tick(RawSample(self._stamp_ns, acceleration, (STILL,) * 3, 16.0, 1e5, motors))

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.tick()

    def until(self, reached: Callable[[], bool]) -> bool:
        """Tick until the condition holds; return False when it takes too long."""
        while not reached() and self._ticks < LONGEST:
            self.tick()
        return reached()


@cache
def warm_up() -> list[str]:
    """Fly the hop, once in a process; return the refusals, because code behind a refusal would be
    compiled in flight.
    """
    hop = _Hop()
    stack = hop.stack
    refused = [] if hop.until(lambda: stack.mode is Mode.READY) else ["not ready"]

    def ask(command: mailbox.Command) -> None:
        reply = stack.handle(command)
        if not reply.accepted:
            refused.append(reply.reason)

    ask(mailbox.Arm("", "warm-up"))
    for name, arguments, wait in HOP:
        ask(mailbox.StartBehavior("", "warm-up", name, arguments))
        hop.ticks(A_FEW_TICKS)
        if wait and not hop.until(lambda: stack.behaviors.name is BehaviorName.HOVER):
            refused.append(f"{name} does not end")
    ask(mailbox.ChangeParameters("", "warm-up", {"model.mass": 1.3}))
    ask(mailbox.Emergency("", "warm-up", "land"))
    hop.ticks(A_FEW_TICKS)
    ask(mailbox.Emergency("", "warm-up", "cut"))
    hop.tick()
    return refused
