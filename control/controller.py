"""The protocol of a controller, and its implementation by compiled laws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from control.geometric_law import new_control_memory, step
from control.parameters import ControlParameters, control_record
from control.rotor_lead import RotorLead
from quadrotor.compiled import direct
from quadrotor.records import ACTUATORS, Array, Record, new_reference, new_state
from quadrotor.vehicle_model import MODEL

Law = Callable[[Record, Record, Record, Record, Record, bool, float, Record], None]
"""Compiled law with the arguments of `control.geometric_law.step`."""


class Controller(Protocol):
    """Controller as the vehicle's tick needs it; plain Python is allowed."""

    @property
    def tilt_limited(self) -> bool:
        """Return whether the last step limited the desired force."""
        ...

    @property
    def integrals(self) -> tuple[Array, Array]:
        """Return the integrals of position (m s) and attitude (rad s), (3,) each."""
        ...

    @property
    def disturbance(self) -> Record:
        """Return DISTURBANCE (1,), written before each step, which compensates it."""
        ...

    def configure(self, parameters: ControlParameters, model: Record) -> None: ...

    def weigh(self, mass: float) -> None:
        """Use this mass (kg) from now on."""
        ...

    def reset(self) -> None: ...

    def step(
        self, state: Record, reference: Record, airborne: bool, dt: float, actuators: Record
    ) -> None: ...

    def idle(self, actuators: Record) -> None: ...


class GeometricController:
    """The paper's controller as a `Controller`; records of shape (1,).

    Args:
        law: another compiled law with the same arguments.
        leads: whether the law gets references that lead the rotors (`control.rotor_lead`).
    """

    def __init__(self, law: Law = step, leads: bool = False) -> None:
        self._law = self._step = law
        self._lead = RotorLead(np.zeros(1, MODEL)) if leads else None
        self.memory = new_control_memory()
        self._tilt_limited = self.memory["tilt_limited"]  # a view, made once
        self._gains = control_record(ControlParameters())
        self._model: Record | None = None
        self._idle = np.zeros(1, ACTUATORS)

    def configure(self, parameters: ControlParameters, model: Record) -> None:
        """Set gains and model (MODEL, shape (1,)); the first call compiles."""
        self._gains = control_record(parameters)
        compiled = self._model is not None
        self._model = model.copy()
        self._model_mass = self._model["mass"]  # a view
        self._idle["thrusts"] = model["thrust_min"]
        self._idle["wrench"] = 0.0
        self._idle["wrench"][:, 0] = 4.0 * model["thrust_min"]
        self._idle["motor_references"] = (
            np.sqrt(model["thrust_min"]) / model["motor_slope"] - model["motor_offset"]
        )
        self._idle["scaling"] = 1.0
        if not compiled:  # compiled now rather than in the first tick, which would be seconds late
            records = self.memory, new_state(), new_reference(), self._gains, self._model
            self._step = direct(self._law, *records, True, 0.002, np.zeros(1, ACTUATORS))

    def weigh(self, mass: float) -> None:
        """Use this mass (kg) from now on. Raises RuntimeError when not configured."""
        if self._model is None:
            raise RuntimeError(f"{type(self).__name__}.weigh before configure")
        self._model_mass[0] = mass

    def reset(self) -> None:
        """Reset the integrals."""
        self.memory[...] = new_control_memory()
        if self._lead is not None:
            self._lead.reset()

    @property
    def disturbance(self) -> Record:
        """Return DISTURBANCE (1,), to be written before a step.

        The step subtracts it from force and torque.
        """
        found: Record = self.memory["disturbance"]
        return found

    @property
    def integrals(self) -> tuple[Array, Array]:
        """Return the integrals of position (m s, world) and attitude (rad s, body), (3,) each."""
        return self.memory["position_integral_w"][0], self.memory["attitude_integral_b"][0]

    @property
    def tilt_limited(self) -> bool:
        return bool(self._tilt_limited.item())

    def step(
        self, state: Record, reference: Record, airborne: bool, dt: float, actuators: Record
    ) -> None:
        """Compute one tick into `actuators`. Raises RuntimeError when not configured."""
        if self._model is None:
            raise RuntimeError(f"{type(self).__name__}.step before configure")
        if self._lead is not None:
            reference = self._lead.step(reference, state, self._model, dt)
        records = self.memory, state, reference, self._gains, self._model
        self._step(*records, airborne, dt, actuators)

    def idle(self, actuators: Record) -> None:
        """Set all motors to their smallest reference, for an armed vehicle on the ground."""
        actuators[...] = self._idle
