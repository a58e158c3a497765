"""A step or a doublet on one axis, from hover and back to it, for tuning gains."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from control.behaviors.behavior import (
    Context,
    TickInputs,
    TrajectoryBehavior,
    check_clear,
    check_inside,
)
from control.behaviors.table import BehaviorName
from control.trajectories.limits import with_margin
from control.trajectories.multistep import AXES, LEAD, POSITION, SHAPES, Multistep
from quadrotor.errors import Refusal, RefusedError
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Record
from quadrotor.vehicle_model import GRAVITY

LONGEST = 40.0
"""Longest duration, in s, of a whole test."""
OUTSIDE = 0.2
"""Distance, in m, by which an overshoot may leave the flight volume."""
AT_REST = (0.15, 0.15, 0.3)
"""Largest position error (m), speed (m/s) and rotation rate (rad/s) at the start."""


class ExciteArguments(Parameters):
    """The arguments of excite."""

    axis: str = parameter("x", choices=AXES)
    """x, y or z of the world, or yaw"""
    shape: str = parameter("step", choices=SHAPES)
    """out and back, or out, to the other side and back"""
    amplitude: float = parameter(0.3, ge=-6.3, le=6.3, step=0.01)
    """of the set-point, m or rad, of either sign"""
    duration: float = parameter(2.0, unit="s", ge=0.2, le=10.0, step=0.1)
    """how long each level is held"""
    repeats: int = parameter(1, ge=1, le=5)
    """how often the shape is flown"""


class Excite(TrajectoryBehavior):
    """Behavior that steps the reference; it brakes when the vehicle leaves the path too far.

    Attributes:
        aborted: why it ended early; empty otherwise.
    """

    name: ClassVar[BehaviorName] = BehaviorName.EXCITE
    arguments: ClassVar[type[Parameters]] = ExciteArguments

    def __init__(self, context: Context, arguments: ExciteArguments) -> None:
        a, p = arguments, context.parameters
        _check_amplitude(a, context)
        path = Multistep(
            context.point,
            axis=a.axis,
            shape=a.shape,
            amplitude=a.amplitude,
            duration=a.duration,
            repeats=a.repeats,
            lead=LEAD,
        )
        if path.duration > LONGEST:
            raise RefusedError(
                f"excite refused: it would take {path.duration:.0f} s; allowed {LONGEST:.0f} s, "
                "try fewer repeats or a shorter duration"
            )
        check_inside(self.name, "the set-point's", np.array(path.ends()), p)
        check_clear(self.name, path.ends(), p)
        _check_demand(a, path.swing, context)
        _check_rest(context)
        super().__init__(path)
        self.aborted = ""
        margin = p.excite_error_max
        low, high = path.ends()
        self._low = [max(x - margin, w - OUTSIDE) for x, w in zip(low, p.low_w, strict=True)]
        self._high = [min(x + margin, w + OUTSIDE) for x, w in zip(high, p.high_w, strict=True)]
        span = max(map(abs, path.span)) if a.axis == "yaw" else 0.0
        self._yaw, self._yaw_error = context.point[3], span + p.excite_yaw_max
        self._tilt_cosine = math.cos(math.radians(context.control.limits.tilt_max))

    def step(self, tick: TickInputs, reference: Record) -> bool:
        self.aborted = self._breach(tick.state)
        if self.aborted:
            _follow(tick.state, reference)
            return True
        return super().step(tick, reference)

    def _breach(self, state: Record) -> str:
        """Return which limit the vehicle has exceeded, and by how much; "" if none."""
        position = state["position_w"][0].tolist()
        for i, axis in enumerate(POSITION):
            # Written so that a NaN is outside.
            if not self._low[i] <= position[i] <= self._high[i]:
                return (
                    f"{axis} = {position[i]:.2f} m is too far off the path or outside the flight "
                    f"volume; allowed {self._low[i]:.2f} to {self._high[i]:.2f} m "
                    "(behavior.excite_error_max, behavior.volume_…)"
                )
        w, x, y, z = state["quaternion_wb"][0].tolist()
        if not 1.0 - 2.0 * (x * x + y * y) >= self._tilt_cosine:
            return "tilted beyond control.limits.tilt_max"
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        error = math.remainder(yaw - self._yaw, 2.0 * math.pi)
        if abs(error) > self._yaw_error and self._yaw_error < math.pi:
            return f"yaw is {error:.2f} rad off (behavior.excite_yaw_max)"
        return ""


def _check_amplitude(a: ExciteArguments, context: Context) -> None:
    """Raise RefusedError when the amplitude exceeds its bound, or is lost in the noise."""
    p, size = context.parameters, abs(a.amplitude)
    if a.axis == "yaw":
        name, unit, most = "excite_yaw_max", "rad", p.excite_yaw_max
    else:
        name, unit, most = "excite_position_max", "m", p.excite_position_max
    if size > most + 1e-9:
        raise RefusedError(
            f"excite refused: an amplitude of {size:.3g} {unit} on {a.axis}; allowed {most:.3g} "
            f"{unit} (behavior.{name})"
        )
    if size < 0.01:
        raise RefusedError(
            f"excite refused: an amplitude of {size:.3g} {unit} on {a.axis} is within the noise; "
            f"allowed 0.01 to {most:.3g} {unit}"
        )


def _check_demand(a: ExciteArguments, swing: float, context: Context) -> None:
    """Raise RefusedError when the jump alone, with these gains, demands too much.

    The law answers a jump e with the acceleration k_p e (eq. 4) within one tick.
    """
    p, gains = context.parameters, context.control.position
    if a.axis in ("x", "y"):
        tilt = math.degrees(math.atan(gains.kp_xy * swing / GRAVITY))
        if tilt > p.trajectory_tilt_max:
            most = GRAVITY * math.tan(math.radians(p.trajectory_tilt_max)) / gains.kp_xy
            raise _too_much(
                f"a tilt of {tilt:.0f}°",
                f"{p.trajectory_tilt_max:g}° (behavior.trajectory_tilt_max)",
                most,
                swing,
                a,
            )
    elif a.axis == "z":
        model = context.model
        low, high = with_margin(
            float(model["thrust_min"][0]), float(model["thrust_max"][0]), p.trajectory_thrust_margin
        )
        rotor = 0.25 * context.hover_thrust  # thrust of each rotor in hover, N
        room = min(high - rotor, rotor - low) / rotor * GRAVITY  # m/s^2, either way
        if gains.kp_z * swing > room:
            raise _too_much(
                f"{gains.kp_z * swing:.1f} m/s²",
                f"{room:.1f} m/s² (the rotors, less behavior.trajectory_thrust_margin)",
                room / gains.kp_z,
                swing,
                a,
            )


def _too_much(
    asked: str, allowed: str, most: float, swing: float, a: ExciteArguments
) -> RefusedError:
    """Return the refusal of a jump of `swing` (m), of which `most` (m) would be allowed."""
    fits = math.floor(100.0 * most * abs(a.amplitude) / swing) / 100.0
    return RefusedError(
        f"excite refused: with these gains its edges ask for {asked}; allowed {allowed}: "
        f"try an amplitude of {fits:g} m"
    )


def _check_rest(context: Context) -> None:
    """Raise RefusedError when the vehicle is not at rest at its reference."""
    state = context.state
    if state is None:
        return
    error, speed, turn = (
        float(np.linalg.norm(v))
        for v in (
            state["position_w"][0] - context.reference["position_w"][0],
            state["velocity_w"][0],
            state["angular_velocity_b"][0],
        )
    )
    if not (error <= AT_REST[0] and speed <= AT_REST[1] and turn <= AT_REST[2]):
        raise RefusedError(
            f"excite refused: not at rest: {error:.2f} m off, {speed:.2f} m/s, {turn:.2f} rad/s; "
            f"allowed {AT_REST[0]} m, {AT_REST[1]} m/s, {AT_REST[2]} rad/s; wait or lower the "
            "gains",
            Refusal.NOT_AT_REST,
        )


def _follow(state: Record, reference: Record) -> None:
    """Move the reference to the vehicle, with its motion; brake continues from there."""
    reference.view("f8")[:] = 0.0
    position, velocity = state["position_w"][0], state["velocity_w"][0]
    if math.isfinite(float(position.sum() + velocity.sum())):
        reference["position_w"], reference["velocity_w"] = position, velocity
    w, x, y, z = state["quaternion_wb"][0].tolist()
    reference["yaw"] = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
