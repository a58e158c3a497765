"""Reports what stays at its bound: a bias, an integral, an estimate, or what a law may ask for.

A value that its bound holds is not the one that the flight needs: a bias at its bound turns the
estimate, an integral at its bound leaves an error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from vehicle import mailbox
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.tick_record import TickRecord
from vehicle.modes import Flag
from vehicle.parameters import VehicleParameters

HELD_NS = 1_000_000_000
"""Time in ns at a bound after which it counts."""
EVERY_NS = 50_000_000
"""Time in ns between two looks."""
NEARLY = 1.0 - 1e-6
"""Share of a bound from which a value counts as at it."""

Bound = tuple[str, float, float]
"""Name of the parameter, largest value on any axis and bound, both positive."""


class BoundsWatch:
    """Looks at the bounds of the estimator and of the control law in use.

    Args:
        say: takes a line for the log and its level.

    Attributes:
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        tick: TickRecord,
        law: ControlLaw,
        say: Callable[[str, int], None],
    ) -> None:
        self._parameters, self._tick, self._law, self._say = parameters, tick, law, say
        self.flags = 0
        self._next_ns = 0
        self._since: dict[str, int] = {}
        self._told: set[str] = set()

    def step(self, now_ns: int, is_controlled: bool) -> None:
        """Look, if it is time; called once a tick.

        Args:
            is_controlled: whether the law flies the vehicle; otherwise its values are old.
        """
        if now_ns < self._next_ns:
            return
        self._next_ns = now_ns + EVERY_NS
        reached = [one for one in self._bounds(is_controlled) if one[1] >= NEARLY * one[2] > 0.0]
        self._since = {name: self._since.get(name, now_ns) for name, _, _ in reached}
        held = {name for name, since in self._since.items() if now_ns - since > HELD_NS}
        for name, _, bound in reached:
            if name in held - self._told:
                self._say(
                    f"{name} = {bound:g} has held what it bounds for a second: what the flight "
                    "needs is beyond it",
                    mailbox.WARN,
                )
        for name in sorted(self._told - held):
            self._say(f"{name} holds no longer", mailbox.INFO)
        self._told = held
        self.flags = int(Flag.AT_BOUND) if held else 0

    def _bounds(self, is_controlled: bool) -> Iterator[Bound]:
        p, tick = self._parameters, self._tick
        for sensor in ("gyroscope", "accelerometer"):
            bias = _largest(tick.estimate[f"{sensor}_bias_b"])
            yield (
                f"estimation.{sensor}_bias_limit",
                bias,
                getattr(p.estimation, f"{sensor}_bias_limit"),
            )
        if not is_controlled:
            return
        controller, limits, taken = self._law.controller, p.control.limits, p.control.disturbance
        position, attitude = (_largest(one) for one in controller.integrals)
        yield "control.limits.position_integral_max", position, limits.position_integral_max
        yield "control.limits.attitude_integral_max", attitude, limits.attitude_integral_max
        yield "control.limits.yaw_torque_max", abs(float(tick.wrench[3])), limits.yaw_torque_max
        yield "control.limits.tilt_max", limits.tilt_max * controller.tilt_limited, limits.tilt_max
        off = controller.disturbance
        if taken.force:
            yield "control.disturbance.force_max", _largest(off["force_w"]), taken.force_max
        if taken.torque:
            yield "control.disturbance.torque_max", _largest(off["torque_b"]), taken.torque_max
        mass = float(tick.estimate["mass"][0])
        yield "mass.mass_max", mass, p.mass.mass_max
        if mass > 0.0:
            yield "mass.mass_min", p.mass.mass_min, mass


def _largest(values: np.typing.NDArray[np.float64]) -> float:
    return float(np.abs(values).max())
