"""The laws of compiled flights: the paper's, and those of extensions by a pointer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

import numba
import numpy as np

from control.laws import CompiledLaw, Own, Records, example_arguments, extended
from control.parameters import GEOMETRIC
from extensions.batches.loop import CASE, HISTORY, OUTCOME, fly
from extensions.batches.onboard import new_onboard
from quadrotor.compiled import compiled
from quadrotor.errors import OutOfBoundsError
from quadrotor.records import REFERENCE, Record
from vehicle.simulator.plant import PLANT


@compiled(pointer=True)
def _nothing(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Stand for the law of an extension where the paper's flies."""


NOTHING = CompiledLaw(_nothing, np.dtype([("unused", "i8")]))


def laws_of(names: Iterable[str], others: Mapping[str, CompiledLaw]) -> dict[str, CompiledLaw]:
    """Return the laws of these names, with those of the caller. Raises OutOfBoundsError for one
    that is not compiled.
    """
    there, found = extended(), {GEOMETRIC: NOTHING, **others}
    for name in {*names} - found.keys():
        if name not in there:
            raise OutOfBoundsError(
                f"control.law = {name!r}: compiled flights have {', '.join((GEOMETRIC, *there))}; "
                "fly others with quadlab fly"
            )
        found[name] = there[name].load()
    return found


@cache
def entry() -> Callable[..., None]:
    """Return the machine code of `fly`, which takes any law of the one signature."""
    case, onboard, settings = np.zeros(1, CASE), new_onboard(), np.zeros(1, np.uint8)
    kind_of: Callable[[object], object] = numba.typeof
    pointer = numba.types.FunctionType(
        numba.types.void(*map(kind_of, example_arguments(NOTHING, settings)))
    )
    records = (
        *(case, np.zeros(1, PLANT), onboard, np.zeros(0, REFERENCE)),
        *(np.zeros(1, OUTCOME), np.zeros(0, HISTORY)),
    )
    own = NOTHING.new_memory(), settings
    kinds = [*map(kind_of, (*records, np.zeros((2, 4)))), pointer]
    compiler: Any = fly
    made: Callable[..., None] = compiler.compile(
        (*kinds, kind_of(own), kind_of(records_of(case, onboard)))
    )
    return made


def records_of(case: Record, onboard: Record) -> Records:
    """Return the records of which a law is a function; they are parts of these."""
    s = case["settings"]
    return onboard["state"], onboard["reference"], s["control"], s["model"], onboard["actuators"]
