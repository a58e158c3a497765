"""The input and answer of a plugin: vectors of float64, little-endian, in SI units, without
padding. A UDP packet and a call of a Python plugin have the same content."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
import numpy.typing as npt

from quadrotor.records import Record

Array = npt.NDArray[np.float64]
KINDS = ("law", "estimator", "behavior", "sensor")


class Field(NamedTuple):
    """One named vector: its name, number of values, unit, meaning, and shape if it is a table."""

    name: str
    size: int
    unit: str
    meaning: str
    shape: tuple[int, ...] = ()


Vector = Annotated[Array, (3,)]
"""Array of 3 numbers."""
Quaternion = Annotated[Array, (4,)]
"""Array of 4 numbers: w, x, y, z."""


def fields_of(kind: type) -> tuple[Field, ...]:
    """Return the fields of a class whose attributes are annotated with unit and meaning."""
    found: list[Field] = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        *shapes, unit, meaning = hint.__metadata__
        shape = shapes[0] if shapes else ()
        table = shape if len(shape) > 1 else ()
        found.append(Field(name, math.prod(shape), unit, meaning, table))
    return tuple(found)


@dataclass(frozen=True)
class Contract:
    """One kind of plugin; it can be pickled.

    Args:
        kind: "law" or "estimator", the name that a file defines.
        input_fields, output_fields: each begins with `time`, s; the inputs have `reset`.
        step: calls a plugin with one input, fields as attributes, and writes the output (1,).
        rehearsal: inputs that it is stepped with before it counts as loaded, so that nothing is
            imported or compiled in the first tick.
        optional: outputs that an FMU may leave out, with the number that then stands there.
        protocol: version of inputs, outputs and methods, which a file states as `PROTOCOL`.
        changes: what to change in a file of each older version.
    """

    kind: str
    input_fields: tuple[Field, ...]
    output_fields: tuple[Field, ...]
    step: Callable[[Any, Any, Record], None]
    rehearsal: tuple[Record, ...] = ()
    optional: Mapping[str, float] = field(default_factory=dict)
    protocol: int = 1
    changes: Mapping[int, str] = field(default_factory=dict)

    @cached_property
    def inputs(self) -> np.dtype[np.void]:
        """Return the packed type of the inputs."""
        return layout(self.input_fields)

    @cached_property
    def outputs(self) -> np.dtype[np.void]:
        """Return the packed type of the outputs."""
        return layout(self.output_fields)

    @property
    def group(self) -> str:
        """Return the group of the entry points by which installed packages offer it."""
        return f"quadlab.{self.kind}s"


def layout(fields: tuple[Field, ...]) -> np.dtype[np.void]:
    """Return the fields as a packed structured type of little-endian doubles."""
    return np.dtype(
        [(f.name, "<f8") if f.size == 1 else (f.name, "<f8", f.shape or f.size) for f in fields]
    )


def names_of(field: Field) -> list[str]:
    """Return the names of a field's numbers as FMUs have them, counted from 1."""
    if field.size == 1:
        return [field.name]
    places = product(*(range(1, n + 1) for n in field.shape or (field.size,)))
    return [f"{field.name}[{','.join(map(str, place))}]" for place in places]


def as_attributes(x: Record) -> Any:
    """Return a record (1,) in the form that a plugin receives: fields as attributes."""
    return x.view(np.recarray)[0]
