"""The protocol of a behavior, the context that it starts from, and its arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import ClassVar, Self, TypeVar

import numpy as np
import numpy.typing as npt

from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from control.keep_out import AROUND, first_encounter
from control.parameters import ControlParameters
from control.trajectories.polynomial import Polynomial
from control.trajectories.trajectory import Trajectory
from quadrotor.errors import RefusedError, UnknownParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue, coerce
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.records import Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel

Joy = tuple[int, Sequence[float], bool]
"""Stamp (ns), axes (forward, left, up, yaw) in -1..1, dead-man held."""

Point = tuple[float, float, float, float]
"""x, y, z (m), yaw (rad)."""


class ExternalReference:
    """The newest reference that another program requests; written between ticks.

    Attributes:
        stamp_ns: when it is to be flown, on the vehicle's clock; None before the first.
        reference: REFERENCE, shape (1,).
        has_ended: whether there will be no more. failure: why, when that was not intended.
    """

    def __init__(self) -> None:
        self.begin()
        self.stamp_ns: int | None = None
        self.reference = new_reference()
        self._floats = self.reference.view("f8")

    def begin(self) -> None:
        """Expect references again after an end."""
        self.has_ended, self.failure = False, ""

    def store(self, stamp_ns: int, numbers: Sequence[float]) -> None:
        """Store `numbers` (18,), in the order of REFERENCE's fields."""
        self.stamp_ns = stamp_ns
        self._floats[:] = numbers


@dataclass(frozen=True, slots=True)
class Context:
    """The context available to a behavior at its start."""

    reference: Record  # copy of the present one; on the ground, the vehicle's pose
    parameters: BehaviorParameters
    hover_thrust: float  # N, the weight
    model: Record = field(default_factory=lambda: VehicleModel().record())  # MODEL, shape (1,)
    trajectories: Mapping[str, Polynomial] = field(default_factory=dict)  # loaded from files
    control: ControlParameters = field(default_factory=ControlParameters)  # gains in use
    state: Record | None = None  # of the vehicle, if known
    outside: ExternalReference = field(default_factory=ExternalReference)
    stamp_ns: int = 0  # of the last tick in flight, on the vehicle's clock

    @property
    def point(self) -> Point:
        x, y, z = self.reference["position_w"][0].tolist()
        return x, y, z, float(self.reference["yaw"][0])


class NoArguments(Parameters):
    """The arguments of a behavior without any."""


@dataclass(slots=True)
class TickInputs:
    """The inputs of a behavior in one tick; one object is reused."""

    stamp_ns: int = 0  # the vehicle's clock, as for the stamps of `joy`
    dt: float = 0.0  # s since the last tick
    state: Record = field(default_factory=new_state)  # STATE, shape (1,)
    joy: Joy | None = None  # the newest sticks
    thrust: float = 0.0  # N, commanded in the last tick


class Behavior:
    """Base class of behaviors; one at a time is active."""

    name: ClassVar[BehaviorName]
    arguments: ClassVar[type[Parameters]] = NoArguments

    def __init__(self, context: Context, arguments: object) -> None:
        """Start from the present reference.

        Raises RefusedError when the arguments lead to a forbidden place.
        """
        raise NotImplementedError

    @classmethod
    def start(cls, context: Context, given: Mapping[str, ParameterValue]) -> Self:
        """Start with the given arguments. Raises ParameterError or RefusedError."""
        return cls(context, read_arguments(cls.name, cls.defaults(context), given))

    @classmethod
    def defaults(cls, context: Context) -> Parameters:
        """Return the values of the arguments that are not given."""
        return cls.arguments()

    @property
    def progress(self) -> float:
        """Return the completed share, 0..1; 0 for behaviors without an end."""
        return 0.0

    def step(self, tick: TickInputs, reference: Record) -> bool:
        """Advance `reference`, which holds the last one; return whether the behavior has ended."""
        raise NotImplementedError


class TrajectoryBehavior(Behavior):
    """Behavior that flies one trajectory and ends with it."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._sample = trajectory.sample
        self._duration = trajectory.duration
        self._elapsed = 0.0

    @property
    def progress(self) -> float:
        return min(1.0, self._elapsed / self._duration)

    def step(self, tick: TickInputs, reference: Record) -> bool:
        self._elapsed += tick.dt
        self._sample(self._elapsed, reference)
        return self._elapsed >= self._duration


Arguments = TypeVar("Arguments", bound=Parameters)


@cache
def argument_descriptions(arguments: type[Parameters]) -> dict[str, ParameterDescription]:
    """Return name → description of the arguments of a behavior."""
    return {d.name: d for d in ParameterStore(arguments()).descriptions()}


def read_arguments(
    behavior: BehaviorName, defaults: Arguments, given: Mapping[str, ParameterValue]
) -> Arguments:
    """Return `defaults` with the given values; none is dropped silently.

    Raises ParameterError.
    """
    known = argument_descriptions(type(defaults))
    checked = {}
    for name, value in given.items():
        if name not in known:
            takes = ", ".join(known) if known else "no arguments"
            raise UnknownParameterError(
                f"{behavior.name.lower()} has no argument {name!r}: it takes {takes}"
            )
        checked[name] = coerce(known[name], value)
    return defaults.model_copy(update=checked)


def check_inside(
    behavior: BehaviorName,
    what: str,
    points_w: npt.NDArray[np.float64],
    parameters: BehaviorParameters,
    start_w: Sequence[float] | None = None,
) -> None:
    """Raise RefusedError with the numbers when a point (N, 3) is outside the flight volume.

    A path that starts outside (`start_w`) may lead back in.
    """
    p = parameters
    for i, (axis, low, high) in enumerate(zip("xyz", p.low_w, p.high_w, strict=True)):
        least, most = float(points_w[:, i].min()), float(points_w[:, i].max())
        start = low if start_w is None else start_w[i]
        below = least < min(low, start) - 1e-6
        if below or most > max(high, start) + 1e-6:
            worst = least if below else most
            raise RefusedError(
                f"{behavior.name.lower()} refused: {what} {axis} = {worst:.2f} m is outside the "
                f"flight volume; allowed {low:g} to {high:g} m "
                f"(behavior.volume_{axis}_min, behavior.volume_{axis}_max)"
            )


def check_clear(
    behavior: BehaviorName,
    path_w: npt.ArrayLike,
    parameters: BehaviorParameters,
    *,
    may_leave: bool = False,
) -> None:
    """Raise RefusedError when a polyline (N, 3) comes too near to a keep-out box; `may_leave` as in
    `first_encounter`.
    """
    p = parameters
    if near := first_encounter(p.boxes, path_w, p.keep_out_margin, may_leave=may_leave):
        raise RefusedError(f"{behavior.name.lower()} refused: it leads {near}; {AROUND}")
