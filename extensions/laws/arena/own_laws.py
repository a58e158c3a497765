"""Laws of users' files and packages in the compiled flights of the arena, called from machine code.

A tick takes some tens of microseconds instead of one, and the answer acts in the same tick, whereas
in the vehicle it acts one tick later. The built-in law does not take over: a law that raises or
answers what is not finite has no thrust from then on, so that it crashes and is counted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

import numba
import numpy as np

from control.geometric_law import apply_wrench
from control.laws import Bytes, CompiledLaw, Own, Records
from quadrotor.errors import RefusedError, UsageError
from quadrotor.python_file import call_user_code
from quadrotor.records import Record
from vehicle.laws.contract import INPUT_TYPE, LAW, OUTPUT_TYPE, Law, load, step
from vehicle.laws.external import ANSWER, REFERENCE_FIELDS
from vehicle.laws.offer import plugins_of
from vehicle.plugins.contract import as_attributes

MEMORY = np.dtype([("ticks", "i8"), ("failed", "i8")])
STATE_FIELDS = "position_w", "velocity_w", "quaternion_wb", "angular_velocity_b"


@dataclass
class OwnLaw:
    """A user's law, loaded when it is chosen; its flights follow each other.

    Attributes:
        sources: as `vehicle.plugins.host.load` takes them; more than one is a mistake.
        failures: the reasons for which it was out, in the order of their first appearance.
    """

    sources: list[str]
    failures: dict[str, None] = field(default_factory=dict)

    @cached_property
    def law(self) -> Law:
        """Return the law, which has answered the inputs of the rehearsal.

        Raises UsageError for two of one name, and with file and line for a file that holds no law,
        or one that fails.
        """
        if len(self.sources) > 1:
            told = " and ".join(Path(one).name for one in self.sources)
            raise UsageError(f"two files or packages have one name, {told}; rename one")
        law, out = load(self.sources[0]), np.zeros(1, OUTPUT_TYPE)
        for x in LAW.rehearsal:
            answer = partial(step, law, as_attributes(x), out)
            call_user_code(Path(self.sources[0]), answer, UsageError)
        return law

    def tick(self, memory: Bytes, records: Records, airborne: bool, dt: float) -> None:
        """Compute one tick into the actuators; a memory of zeros begins a flight."""
        known, (state, reference, _, model, actuators) = memory.view(MEMORY), records
        # New in each tick: the law may keep and write it.
        x, out = np.zeros(1, INPUT_TYPE), np.zeros(1, ANSWER)
        x["time"], x["dt"], x["flying"] = dt * (known["ticks"] + 1), dt, airborne
        x["reset"] = known["ticks"] == 0
        x["mass"], x["inertia_b"] = model["mass"], model["inertia_b"]
        for name in STATE_FIELDS:
            x[name] = state[name]
        for name in REFERENCE_FIELDS:
            x[f"reference_{name}"] = reference[name]
        known["ticks"] += 1
        if not known["failed"][0]:
            try:
                self._answer(x, out)
            except RefusedError as error:
                known["failed"] = 1
                self.failures[str(error)] = None
                out[:] = 0.0
        apply_wrench(out["wrench"], model, actuators)

    def _answer(self, x: Record, out: Record) -> None:
        """Write the law's answer. Raises RefusedError when it has none that can be flown."""
        answer = partial(step, self.law, as_attributes(x), out.view(OUTPUT_TYPE))
        call_user_code(Path(self.sources[0]), answer, RefusedError)
        if not np.isfinite(out["wrench"]).all():
            raise RefusedError(f"it answered {out['wrench'][0].tolist()}, which is not finite")

    @cached_property
    def compiled(self) -> CompiledLaw:
        """Return it as a law that compiled flights call, of one thread at a time.

        Raises UsageError as `law` does.
        """
        _, tick = self.law, self.tick

        @numba.njit(error_model="numpy")
        def call(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
            memory, _ = own
            state, reference, gains, model, actuators = records
            with numba.objmode():
                tick(memory, (state, reference, gains, model, actuators), airborne, dt)

        return CompiledLaw(call, MEMORY, leads=False)


def own_laws(folder: Path | None) -> dict[str, OwnLaw]:
    """Return the laws of a folder and of installed packages by name."""
    return {name: OwnLaw(sources) for name, sources in plugins_of(folder).sources().items()}
