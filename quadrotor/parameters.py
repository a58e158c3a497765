"""Parameters: one pydantic model for each component, the only source of names, bounds and units.

Command-line flags, the ROS 2 parameter services, the sliders, the log's snapshot and
docs/parameters.md are derived from it. A `ParameterStore` is the authority for one tree of
components: it validates, applies, counts revisions, and never applies a change in part.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, create_model

from quadrotor.errors import ReadOnlyError, UnknownParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue, coerce
from quadrotor.similar_names import did_you_mean


class Parameters(BaseModel):
    """Base of every component's parameters.

    Fields are made with `parameter`; the docstring below a field is its description.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    def check_together(self) -> None:
        """Check conditions on several fields; a store calls it when all values of a change are set.

        Raises OutOfBoundsError.
        """


Section = TypeVar("Section", bound=Parameters)


def parameter(
    default: ParameterValue,
    *,
    description: str | None = None,
    unit: str = "",
    ge: float | None = None,
    le: float | None = None,
    step: float | None = None,
    read_only: bool = False,
    choices: tuple[str, ...] = (),
    flight_step: float | None = None,
) -> Any:
    """Return a scalar field with unit, bounds, slider step and description.

    Vectors are written as named scalars (`kp_xy`, `kp_z`): each has its own bounds and slider.

    Args:
        description: replaces the docstring below the field.
        flight_step: largest change in flight, for a float that acts on the motors at once.
    """
    extra: dict[str, Any] = {"unit": unit, "step": step, "read_only": read_only}
    extra |= {"choices": list(choices), "flight_step": flight_step}
    return Field(default, ge=ge, le=le, description=description, json_schema_extra=extra)


def parameters_of(base: type[Section], name: str, fields: Mapping[str, object]) -> type[Section]:
    """Return a model with further fields, `{name: (type, default)}`, that have no docstrings."""
    quick = {"use_attribute_docstrings": False}  # else Pydantic asks each loaded module for them
    return create_model(name, __base__=base, __cls_kwargs__=quick, **fields)  # type: ignore[call-overload, no-any-return]


def section_of(kind: type[Section], prefix: str, values: Mapping[str, object]) -> Section:
    """Return a component with those of these values whose names are `prefix` and a field."""
    known = {name: values[prefix + name] for name in kind.model_fields if prefix + name in values}
    return kind().model_copy(update=known)


FEW_MEMBERS = 8
"""Largest number of members of a group that an error message lists."""


class ParameterStore:
    """Flat names (`position.kp_xy`) over a tree of `Parameters`; for its single writer.

    Args:
        root: a `Parameters` whose fields are components (`Parameters`) of scalar fields.
    """

    def __init__(self, root: Parameters) -> None:
        self._root = root
        self._places: dict[str, tuple[Parameters, str]] = dict(_walk(root, ""))
        self._descriptions = {
            name: _describe(name, type(owner), field, _choices(type(owner), field))
            for name, (owner, field) in self._places.items()
        }
        self.revision = 0

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._places)

    def description(self, name: str) -> ParameterDescription:
        """Return a parameter's description. Raises UnknownParameterError."""
        self._require(name)
        return self._descriptions[name]

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return tuple(self._descriptions.values())

    def get(self, name: str) -> ParameterValue:
        """Return a parameter's value. Raises UnknownParameterError."""
        self._require(name)
        owner, field = self._places[name]
        value: ParameterValue = getattr(owner, field)
        return value

    def values(self) -> dict[str, ParameterValue]:
        return {name: self.get(name) for name in self._places}

    def check(self, name: str, value: object) -> ParameterValue:
        """Return the value as it would be applied.

        Raises UnknownParameterError, WrongTypeError, OutOfBoundsError or ReadOnlyError.
        """
        self._require(name)
        description = self._descriptions[name]
        if description.read_only:
            raise ReadOnlyError(
                f"parameter {name} cannot be changed while running "
                f"(it is {self.get(name)}); set it at the start with --set {name}=…"
            )
        return coerce(description, value)

    def set(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        """Apply all or nothing; return the applied values. Raises as `check` does."""
        checked = {name: self.check(name, value) for name, value in values.items()}
        self._apply(checked)
        return checked

    def preset(self, values: Mapping[str, object]) -> None:
        """Set values as `set` does, before the start: read-only parameters too."""
        for name in values:
            self._require(name)
        self._apply({n: coerce(self._descriptions[n], v) for n, v in values.items()})

    def _apply(self, values: Mapping[str, ParameterValue]) -> None:
        before = {name: self.get(name) for name in values}
        try:
            self._assign(values)
            owners = {id(owner): owner for owner, _ in (self._places[name] for name in values)}
            for owner in owners.values():
                owner.check_together()
        except Exception:  # from the model's own validator: all or nothing also applies here
            self._assign(before)
            raise
        if values:
            self.revision += 1

    def _assign(self, values: Mapping[str, ParameterValue]) -> None:
        for name, value in values.items():
            owner, field = self._places[name]
            setattr(owner, field, value)

    def _require(self, name: str) -> None:
        if name not in self._places:
            raise UnknownParameterError(f"unknown parameter {name!r}: {self._hint(name)}")

    def _hint(self, name: str) -> str:
        """Return what to try instead of an unknown name, from its own group if there is one."""
        group = name.rpartition(".")[0]
        members = [one for one in self._places if one.rpartition(".")[0] == group]
        few = group and 0 < len(members) <= FEW_MEMBERS
        cutoff = 0.8 if few else 0.5
        if question := did_you_mean(name, members or self._places, cutoff=cutoff):
            return question
        if few:
            return f"{group} has {', '.join(one.rpartition('.')[2] for one in members)}"
        return "docs/parameters.md lists them all"


def _walk(owner: Parameters, prefix: str) -> Iterator[tuple[str, tuple[Parameters, str]]]:
    for field in type(owner).model_fields:
        value = getattr(owner, field)
        if isinstance(value, Parameters):
            yield from _walk(value, f"{prefix}{field}.")
        else:
            yield f"{prefix}{field}", (owner, field)


def _choices(owner: type[Parameters], of: str) -> tuple[str, ...]:
    """Return the values that a text may have; registered plugins add to them."""
    extra = owner.model_fields[of].json_schema_extra
    choices = extra.get("choices") if isinstance(extra, dict) else None
    return tuple(map(str, choices)) if isinstance(choices, list) else ()


def offer_choices(owner: type[Parameters], of: str, choices: Iterable[str]) -> None:
    """Make these the values that a text may have in the trees whose store is made from now on."""
    extra: Any = owner.model_fields[of].json_schema_extra
    extra["choices"][:] = choices


@lru_cache(maxsize=4096)
def _describe(
    name: str, owner: type[Parameters], of: str, choices: tuple[str, ...]
) -> ParameterDescription:
    field = owner.model_fields[of]
    extra = field.json_schema_extra
    if not isinstance(extra, dict):
        raise TypeError(f"{name} was not made with quadrotor.parameters.parameter")
    if not field.description:
        raise TypeError(f"{name} has no description: write a docstring below it")
    given = ((key, getattr(one, key, None)) for one in field.metadata for key in ("ge", "le"))
    bounds = {key: float(limit) for key, limit in given if limit is not None}
    kind = field.annotation.__name__ if field.annotation else "str"
    step, flight_step = extra.get("step"), extra.get("flight_step")
    if flight_step is not None and kind != "float":
        raise TypeError(f"{name}: only a float can be limited to a step in flight")
    return ParameterDescription(
        name=name,
        type=kind,
        default=field.default,
        description=" ".join(field.description.split()),
        unit=str(extra.get("unit", "")),
        minimum=bounds.get("ge"),
        maximum=bounds.get("le"),
        step=float(step) if isinstance(step, int | float) else None,
        read_only=bool(extra.get("read_only")),
        choices=choices,
        flight_step=float(flight_step) if isinstance(flight_step, int | float) else None,
    )
