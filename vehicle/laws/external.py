"""An external law above a built-in one that can take over in any tick."""

from __future__ import annotations

import math

import numpy as np

from control.controller import GeometricController
from control.geometric_law import apply_wrench
from control.parameters import GEOMETRIC, ControlParameters
from quadrotor.errors import RefusedError
from quadrotor.records import ACTUATORS, Record
from quadrotor.vehicle_model import GRAVITY, MODEL
from vehicle.laws.contract import LAW, Array
from vehicle.plugins.external import External
from vehicle.plugins.links import Link


class ExternalLaw(External):
    """A `control.controller.Controller` that flies what an external law answers.

    In each tick the built-in law is stepped, the answer to the last tick's input is read, and the
    next input is sent. A tick without a usable answer flies the built-in law.
    """

    def __init__(self, name: str, link: Link, base: GeometricController, waits: bool) -> None:
        super().__init__(LAW, name, link, waits)
        self.base = base
        self._wrench, self._model = np.zeros((1, 4)), np.zeros(1, MODEL)
        # Compiled here and not in the first tick, which would be seconds late.
        apply_wrench(self._wrench, self._model, np.zeros(1, ACTUATORS))
        self._desired_z_w = base.memory["desired_attitude"][0, :, 2]  # a view

    # ------------------------------------------------------------------ the protocol
    @property
    def tilt_limited(self) -> bool:
        return self.base.tilt_limited

    @property
    def integrals(self) -> tuple[Array, Array]:
        return self.base.integrals

    @property
    def disturbance(self) -> Record:
        return self.base.disturbance

    def configure(self, parameters: ControlParameters, model: Record) -> None:
        self.base.configure(parameters, model)
        self._bounds, self._model = parameters.plugin, model.copy()
        self._out["inertia_b"], self._out["mass"] = model["inertia_b"], model["mass"]

    def weigh(self, mass: float) -> None:
        self.base.weigh(mass)
        self._out["mass"] = self._model["mass"] = mass

    def reset(self) -> None:
        self.base.reset()
        self._out["reset"] = 1.0

    def idle(self, actuators: Record) -> None:
        self.base.idle(actuators)

    def step(
        self, state: Record, reference: Record, airborne: bool, dt: float, actuators: Record
    ) -> None:
        """Compute one tick into `actuators`."""
        # Its integrals rest while another law flies: they would fill with errors not its own.
        self.base.step(state, reference, airborne and not self.flown, dt, actuators)
        if self.failure:
            return
        try:
            wrench = self._wrench_of(state, reference, airborne, dt)
            if wrench is None:
                return
            self._check(wrench, state, reference, actuators)
        except RefusedError as error:
            self.failure = str(error)
            return
        if self.flown:
            self._command(wrench, actuators)

    def summary(self) -> str:
        """Return a line about the flight, and begin to count again."""
        difference = self.difference
        return (
            f"{super().summary()}; its thrust was {difference:.2f} N (rms) from that of {GEOMETRIC}"
        )

    # ------------------------------------------------------------------ parts
    def _wrench_of(
        self, state: Record, reference: Record, airborne: bool, dt: float
    ) -> Array | None:
        """Return the law's wrench (4,), None when there is none yet. Raises RefusedError."""
        answer = self._answer()
        self._input(state, reference, airborne, dt)
        self._ask()
        if answer is None:
            return None
        wrench: Array = answer.view(ANSWER)["wrench"][0]
        return wrench

    def _command(self, wrench: Array, actuators: Record) -> None:
        """Fly the wrench."""
        self._wrench[0] = wrench
        apply_wrench(self._wrench, self._model, actuators)

    def _input(self, state: Record, reference: Record, airborne: bool, dt: float) -> None:
        out = self._out
        out["time"] += dt
        out["dt"], out["flying"] = dt, airborne
        for name in ("position_w", "velocity_w", "quaternion_wb", "angular_velocity_b"):
            out[name] = state[name]
        for name in REFERENCE_FIELDS:
            out[f"reference_{name}"] = reference[name]

    def _check(self, wrench: Array, state: Record, reference: Record, base: Record) -> None:
        """Raise RefusedError when the answer, or the flight on it, is out of bounds."""
        bounds = self._bounds
        if not np.isfinite(wrench).all():
            raise RefusedError(f"it answered {wrench.tolist()}, which is not finite")
        apart = wrench - base["wrench"][0]
        self._squares += float(apart[0]) * float(apart[0])  # a power raises when it overflows
        if not self.flown:
            return
        weight = float(self._model["mass"][0]) * GRAVITY
        built_in = "from what the built-in law commands"
        _bound(abs(apart[0]) / weight, bounds.thrust_max, "its thrust", f"of the weight {built_in}")
        _bound(float(np.abs(apart[1:]).max()), bounds.torque_max, "its torque", f"N m {built_in}")
        w, x, y, z = state["quaternion_wb"][0].tolist()
        z_w = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
        heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        turned = abs(math.remainder(heading - float(reference["yaw"][0]), math.tau))
        _bound(math.degrees(turned), HEADING_MAX, "the heading", "° from the reference")
        cosine = sum(a * float(b) for a, b in zip(z_w, self._desired_z_w, strict=True))
        tilt = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
        _bound(tilt, bounds.tilt_max, "the tilt", "° from what the built-in law wants")
        away = reference["position_w"][0] - state["position_w"][0]
        distance = math.sqrt(float(away @ away))
        _bound(distance, bounds.distance_max, "the position", "m from the reference")


HEADING_MAX = 60.0
"""Largest angle of the heading from its reference, °; a step test of yaw may make 46°. A law
that spins the vehicle up breaks no other bound until the gyroscopes are at the end of their range.
"""
ANSWER = np.dtype([("time", "<f8"), ("wrench", "<f8", 4)])
"""OUTPUT_TYPE with thrust and torque as one vector."""
REFERENCE_FIELDS = (
    "position_w",
    "velocity_w",
    "acceleration_w",
    "jerk_w",
    "snap_w",
    "yaw",
    "yaw_rate",
    "yaw_acceleration",
)


def _bound(value: float, largest: float, what: str, unit: str) -> None:
    if value > largest:
        raise RefusedError(f"{what} is {value:.2f} {unit}, allowed {largest:g}")
