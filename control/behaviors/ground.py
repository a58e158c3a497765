"""The behavior on the ground: the reference is the vehicle's own position."""

from __future__ import annotations

from typing import ClassVar

from control.behaviors.behavior import Behavior, TickInputs
from control.behaviors.table import BehaviorName
from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.rotations import yaw_of


@compiled
def rest_reference(state: Record, reference: Record) -> None:
    """Set reference[0] at rest at the position and yaw of state[0]; both shape (1,)."""
    r = reference[0]
    for i in range(3):
        r.position_w[i] = state[0].position_w[i]
        r.velocity_w[i] = 0.0
        r.acceleration_w[i] = 0.0
        r.jerk_w[i] = 0.0
        r.snap_w[i] = 0.0
    r.yaw = yaw_of(state[0].quaternion_wb)
    r.yaw_rate = 0.0
    r.yaw_acceleration = 0.0


class Ground(Behavior):
    """Behavior on the ground, with motors off or idle."""

    name: ClassVar[BehaviorName] = BehaviorName.GROUND

    def __init__(self) -> None:
        """Need no context: nothing is flown."""

    def step(self, tick: TickInputs, reference: Record) -> bool:
        rest_reference(tick.state, reference)
        return False
