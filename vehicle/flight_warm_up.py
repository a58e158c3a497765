"""Compile every law before the first sample counts.

A throw-away stack flies one short hop through all behaviors: whatever the tick may call has then
been called once, with the types it will see again. From numba's cache this takes 0.3 s.
"""

from __future__ import annotations

from quadrotor.parameters import ParameterValue
from vehicle import mailbox
from vehicle.microcontroller import RawSample
from vehicle.modes import Mode
from vehicle.parameters import new_parameters
from vehicle.stack import FlightStack

PERIOD_NS = 2_000_000
STILL = 512  # counts of a sensor at zero
ONE_G = 256  # counts
TICKS_A_BEHAVIOR = 100
LONGEST = 10_000  # ticks

HOP: tuple[tuple[str, dict[str, ParameterValue]], ...] = (
    ("fly_to", {"x": 0.2, "y": 0.1, "z": 0.8, "yaw": 0.2}),
    ("brake", {}),
    ("follow_trajectory", {"trajectory": "figure_eight"}),
    ("brake", {}),
    ("velocity", {}),
    ("hover", {}),
    ("land", {}),
)


class _Hop:
    """A vehicle that is always where its reference wants it."""

    def __init__(self) -> None:
        parameters = new_parameters()
        parameters.safety.gyro_samples = 50
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
        stack.measure(mailbox.Pose(self._stamp_ns, (x, y, z), (1.0, 0.0, 0.0, 0.0)))
        acceleration = (STILL, STILL, STILL + ONE_G)
        stack.tick(
            RawSample(
                self._stamp_ns, acceleration, (STILL,) * 3, 16.0, 1e5, stack.motor_state_wanted
            )
        )

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.tick()

    def until(self, mode: Mode) -> bool:
        """Tick until the mode is reached; False when it takes too long."""
        while self.stack.mode is not mode and self._ticks < LONGEST:
            self.tick()
        return self.stack.mode is mode


def warm_up() -> list[str]:
    """Fly the hop. Returns what was refused in it: a behavior refused here compiles in flight."""
    hop = _Hop()
    refused = [] if hop.until(Mode.READY) else ["ready"]
    steps: list[mailbox.Command] = [mailbox.Arm("", "warm-up")]
    steps += [mailbox.StartBehavior("", "warm-up", "take_off", {})]
    steps += [mailbox.StartBehavior("", "warm-up", name, given) for name, given in HOP]
    for step in steps:
        reply = hop.stack.handle(step)
        if not reply.accepted:
            refused.append(reply.reason)
        hop.ticks(TICKS_A_BEHAVIOR)
    hop.stack.handle(mailbox.ChangeParameters("", "warm-up", {"model.mass": 1.3}))
    hop.stack.handle(mailbox.Emergency("", "warm-up", "land"))
    hop.ticks(TICKS_A_BEHAVIOR)
    hop.stack.handle(mailbox.Emergency("", "warm-up", "cut"))
    hop.ticks(1)
    return refused
