"""A compiled law of an extension above a built-in one that takes over within the tick."""

from __future__ import annotations

import numpy as np

from control.controller import GeometricController
from control.laws import CompiledLaw, example_arguments, settings_of
from control.parameters import ControlParameters, control_record
from quadrotor.compiled import direct
from quadrotor.errors import RefusedError
from quadrotor.records import ACTUATORS, Record
from vehicle.laws.contract import Array
from vehicle.laws.external import ExternalLaw
from vehicle.plugins.links import NoLink


class _Here(NoLink):
    """Stands for a link to what needs none."""

    def ready(self) -> bool:
        return True


class CompiledController(ExternalLaw):
    """A `control.controller.Controller` that flies the answer of a compiled law in the same tick.

    Args:
        control: with the parameters of the law; the constructor compiles it.
    """

    def __init__(
        self, name: str, law: CompiledLaw, base: GeometricController, control: ControlParameters
    ) -> None:
        super().__init__(name, _Here(""), base, False)
        self._law, self._memory = law, law.new_memory()
        self._gains, self._settings = control_record(control), settings_of(control, name)
        self._last, self._found = np.zeros(1, ACTUATORS), np.zeros(1, ACTUATORS)
        self._numbers = self._found.view(np.float64)
        self._step = direct(law.step, *example_arguments(law, self._settings))

    def configure(self, parameters: ControlParameters, model: Record) -> None:
        super().configure(parameters, model)
        self._gains = control_record(parameters)
        self._settings = settings_of(parameters, self.name)

    def reset(self) -> None:
        super().reset()
        self._memory[:] = 0

    def idle(self, actuators: Record) -> None:
        super().idle(actuators)
        self._last[...] = actuators

    def step(
        self, state: Record, reference: Record, airborne: bool, dt: float, actuators: Record
    ) -> None:
        """Compute one tick into `actuators`."""
        super().step(state, reference, airborne, dt, actuators)
        self._last[...] = actuators

    def summary(self) -> str:
        """Return a line about the flight, and begin to count again."""
        return super().summary().replace(" inputs without an answer in time", " ticks unanswered")

    # ------------------------------------------------------------------ parts
    def _wrench_of(self, state: Record, reference: Record, airborne: bool, dt: float) -> Array:
        own = self._found
        own[...] = self._last
        wanted = self.base.led if self._law.leads else reference
        records = state, wanted, self._gains, self._model, own
        self._step((self._memory, self._settings), records, self.flown, airborne, dt)
        self.ticks += 1
        if not np.isfinite(self._numbers).all():
            raise RefusedError(f"it answered {own['wrench'][0].tolist()}, which is not finite")
        wrench: Array = own["wrench"][0]
        return wrench

    def _command(self, wrench: Array, actuators: Record) -> None:
        super()._command(wrench, actuators)  # what was checked, and no references of its own
        actuators["scaling"] = self._found["scaling"]
