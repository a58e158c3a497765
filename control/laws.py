"""Control laws of extensions: compiled functions of one signature, which the tick calls.

They fly on top of the geometric law, which takes over within the tick when one fails
(`vehicle.laws.compiled`), and in the compiled flights of `quadlab.batch`. A law is

    step(own, records, flown, airborne, dt)

`own` is its memory and its settings, as bytes of which the law makes its own records,
`memory.view(MEMORY)[0]`; a memory of zeros is that of a flight that begins. `records` are STATE,
REFERENCE, CONTROL, MODEL and ACTUATORS, shape (1,). The actuators hold the last tick's commands, of
whichever law was flown, and are overwritten. While `flown` is False the law runs as the shadow of
another; while `airborne` is False the ground carries the vehicle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from control.parameters import CONTROL, GEOMETRIC, NEAR_HOVERING, NONE, ControlParameters
from quadrotor.errors import UsageError
from quadrotor.extension import Law
from quadrotor.extensions import Offered, Registry, registry
from quadrotor.parameters import Parameters, offer_choices, parameters_of
from quadrotor.records import ACTUATORS, Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel

Bytes = npt.NDArray[np.uint8]
Own = tuple[Bytes, Bytes]
Records = tuple[Record, Record, Record, Record, Record]
Step = Callable[[Own, Records, bool, bool, float], None]
BUILT_IN = GEOMETRIC, NEAR_HOVERING
RESERVED = (*BUILT_IN, NONE, "udp", *ControlParameters.model_fields)
"""Names that no law of an extension may have: built-in ones, and the groups beside it."""
TYPES = {"float": "f8", "int": "i8", "bool": "i8"}


@dataclass(frozen=True)
class CompiledLaw:
    """A law, to which the declaration of an extension refers.

    Attributes:
        step: a function compiled by `quadrotor.compiled.compiled(pointer=True)`.
        memory: the type of its memory.
        leads: whether it gets references that lead the rotors (`control.rotor_lead`); False for a
            law that has their lag in its own model.
    """

    step: Step
    memory: np.dtype[np.void]
    leads: bool = True

    def new_memory(self) -> Bytes:
        """Return the memory of a flight that begins."""
        return np.zeros(self.memory.itemsize, np.uint8)


def settings_type(parameters: type[Parameters]) -> np.dtype[np.void]:
    """Return the record of a law's parameters, in their order. Raises UsageError for a text."""
    fields = []
    for name, field in parameters.model_fields.items():
        kind = field.annotation.__name__ if field.annotation else ""
        if kind not in TYPES:
            raise UsageError(f"its parameter {name} is {kind}; allowed are {', '.join(TYPES)}")
        fields.append((name, TYPES[kind]))
    return np.dtype(fields, align=True)


def settings_of(control: ControlParameters, law: str) -> Bytes:
    """Return the parameters of a law as bytes of its `settings_type`, one byte for none."""
    own = getattr(control, law, None)
    if own is None:
        return np.zeros(1, np.uint8)
    kind = settings_type(type(own))
    return np.array([tuple(getattr(own, name) for name in kind.names or ())], kind).view(np.uint8)


def extended() -> dict[str, Offered[Law]]:
    """Return the laws of extensions by name, without those whose parameters cannot be used."""
    return _usable(registry())


@lru_cache(maxsize=1)
def _usable(found: Registry) -> dict[str, Offered[Law]]:
    usable = {}
    for name, law in found.offers(Law, taken=RESERVED).items():
        try:
            if law.offer.parameters:
                settings_type(law.load(law.offer.parameters))
        except UsageError as error:  # all else flies
            found.problems[f"the control law {name} is left out: {error}"] = None
            continue
        usable[name] = law
    return usable


def new_control_parameters() -> ControlParameters:
    """Return the defaults, with a component for each law of an extension that has parameters."""
    return _tree(registry())()


@lru_cache(maxsize=1)
def _tree(found: Registry) -> type[ControlParameters]:
    fields: dict[str, Any] = {}
    for name, law in _usable(found).items():
        if law.offer.parameters:
            kind = law.load(law.offer.parameters)
            fields[name] = (kind, kind())
    return parameters_of(ControlParameters, "ExtendedControlParameters", fields)


def offer(others: Sequence[str]) -> None:
    """Make these names, besides the built-in ones, values of the parameters, in place of those
    offered before: of laws that whoever makes the parameter tree can start.
    """
    offer_choices(ControlParameters, "law", (*BUILT_IN, *others))
    offer_choices(ControlParameters, "shadow_law", (NONE, *others))


def example_arguments(law: CompiledLaw, settings: Bytes) -> tuple[object, ...]:
    """Return arguments of the types with which a law is called, to compile it."""
    gains, model = np.zeros(1, CONTROL), VehicleModel().record()
    records = new_state(), new_reference(), gains, model, np.zeros(1, ACTUATORS)
    return (law.new_memory(), settings), records, True, True, 0.002
