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
from vehicle.laws.contract import INPUT_TYPE, OUTPUT_TYPE
from vehicle.laws.links import Link

CONSECUTIVE, SHARE, MEMORY = 25, 0.2, 1.0 / 500.0
"""Ticks without an answer after which a law is disengaged: that many in a row, or this share of
them; MEMORY is the weight of one tick in the share."""
READ_AT_ONCE = 32
"""Answers read in one tick: a flood must not delay the motors."""


class ExternalLaw:
    """A `control.controller.Controller` that flies what an external law answers.

    In each tick the built-in law is stepped, the answer to the last tick's input is read, and the
    next input is sent. A tick without a usable answer flies the built-in law. `failure` becomes
    the reason once the law must not be used any more.

    Args:
        waits: whether time waits for an answer: one that is missing then ends the law.

    Attributes:
        flown: whether the answer is flown; otherwise it is only compared.
        is_ready: whether it is loaded. failure: why it is out, empty while it is not.
        ticks, missed: inputs of this flight, and those without an answer in time.
    """

    def __init__(self, name: str, link: Link, base: GeometricController, waits: bool) -> None:
        self.name, self.base, self.flown, self.failure = name, base, False, ""
        self.is_ready = False
        self._link, self._waits = link, waits
        self._out = np.zeros(1, INPUT_TYPE)
        self._out["reset"] = 1.0
        self._wrench, self._model = np.zeros((1, 4)), np.zeros(1, MODEL)
        # Compiled here and not in the first tick, which would be seconds late.
        apply_wrench(self._wrench, self._model, np.zeros(1, ACTUATORS))
        self._asked = math.nan
        self.ticks = self.missed = self._in_a_row = 0
        self._share = self._squares = 0.0
        self._desired_z_w = base.memory["desired_attitude"][0, :, 2]  # a view

    # ------------------------------------------------------------------ the protocol
    @property
    def tilt_limited(self) -> bool:
        return self.base.tilt_limited

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
            answer = self._answer()
            self._ask(state, reference, airborne, dt)
            if answer is None:
                return
            self._check(answer, state, reference, actuators)
        except RefusedError as error:
            self.failure = str(error)
            return
        if self.flown:
            self._wrench[0] = answer["wrench"][0]
            apply_wrench(self._wrench, self._model, actuators)

    # ------------------------------------------------------------------ whether it may fly
    def becomes_ready(self) -> bool:
        """Return whether the law is loaded now and was not at the last call."""
        if self.is_ready or self.failure:
            return False
        try:
            self.is_ready = self._link.ready()
        except RefusedError as error:
            self.failure = str(error)
        return self.is_ready

    def summary(self) -> str:
        """Return a line about the flight, and begin to count again."""
        line = (
            f"law {self.name}: {self.missed} of {self.ticks} inputs without an answer in time; "
            f"its thrust was {self.difference:.2f} N (rms) from that of {GEOMETRIC}"
        )
        self.ticks = self.missed = 0
        self._squares = 0.0
        return line

    @property
    def difference(self) -> float:
        """Return the rms difference (N) between its thrust and that of the built-in law."""
        answered = self.ticks - self.missed
        return math.sqrt(self._squares / answered) if answered else math.nan

    def close(self) -> None:
        """End its process."""
        self._link.close()

    # ------------------------------------------------------------------ parts
    def _ask(self, state: Record, reference: Record, airborne: bool, dt: float) -> None:
        out = self._out
        out["time"] += dt
        out["dt"], out["flying"] = dt, airborne
        for name in ("position_w", "velocity_w", "quaternion_wb", "angular_velocity_b"):
            out[name] = state[name]
        for name in REFERENCE_FIELDS:
            out[f"reference_{name}"] = reference[name]
        if not self.is_ready:
            return
        self._link.send(out.tobytes())
        self._asked = out["time"].item()
        out["reset"] = 0.0

    def _answer(self) -> Record | None:
        """Return the answer to the last input as ANSWER (1,); None when there is none yet."""
        if math.isnan(self._asked):
            return None
        self.ticks += 1
        for _ in range(READ_AT_ONCE):
            data = self._link.receive()
            if data is None:
                break
            if len(data) == OUTPUT_TYPE.itemsize:
                answer = np.frombuffer(data, ANSWER)
                if answer["time"].item() == self._asked:
                    self._in_a_row = 0
                    self._share -= MEMORY * self._share
                    return answer
        self.missed += 1
        self._in_a_row += 1
        self._share += MEMORY * (1.0 - self._share)
        if self._waits or self._in_a_row >= CONSECUTIVE or self._share > SHARE:
            raise RefusedError(
                f"no answer in time to {self._in_a_row} inputs in a row, "
                f"{self.missed} of {self.ticks} in all"
            )
        return None

    def _check(self, answer: Record, state: Record, reference: Record, base: Record) -> None:
        """Raise RefusedError when the answer, or the flight on it, is out of bounds."""
        bounds, wrench = self._bounds, answer["wrench"][0]
        if not np.isfinite(wrench).all():
            raise RefusedError(f"it answered {wrench.tolist()}, which is not finite")
        apart = wrench - base["wrench"][0]
        self._squares += float(apart[0]) ** 2
        if not self.flown:
            return
        weight = float(self._model["mass"][0]) * GRAVITY
        built_in = "from what the built-in law commands"
        _bound(abs(apart[0]) / weight, bounds.thrust_max, "its thrust", f"of the weight {built_in}")
        _bound(float(np.abs(apart[1:]).max()), bounds.torque_max, "its torque", f"N m {built_in}")
        w, x, y, z = state["quaternion_wb"][0].tolist()
        z_w = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
        cosine = sum(a * float(b) for a, b in zip(z_w, self._desired_z_w, strict=True))
        tilt = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
        _bound(tilt, bounds.tilt_max, "the tilt", "° from what the built-in law wants")
        away = reference["position_w"][0] - state["position_w"][0]
        distance = math.sqrt(float(away @ away))
        _bound(distance, bounds.distance_max, "the position", "m from the reference")


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
