"""Experiments that several vehicles fly together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

from console.evaluation.result import Result


class Neighbour(NamedTuple):
    """A vehicle at the last meeting: the truth, for sensors, and the message that it broadcast.

    Attributes:
        position_w: m. velocity_w: m/s. quaternion_wb: w, x, y, z. radius: m, around its rotors.
    """

    stamp_ns: int
    position_w: tuple[float, float, float]
    velocity_w: tuple[float, float, float]
    quaternion_wb: tuple[float, float, float, float]
    radius: float
    mail: bytes


class Company(Protocol):
    """The vehicles that fly together, as one of them meets them.

    Attributes:
        names: of all. index: of this one, from 0. seed: of this one's noise.
    """

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def index(self) -> int: ...

    @property
    def seed(self) -> int: ...

    def attitude(self) -> tuple[float, float, float, float]:
        """Return this vehicle's own estimate of its attitude, w, x, y, z, body to world."""
        ...

    def neighbour(self, index: int) -> Neighbour:
        """Return a vehicle, this one too, as it was at the last meeting."""
        ...

    def broadcast(self, mail: bytes) -> None:
        """Send bytes, which the others get at the next meeting."""
        ...

    def log(self, topic: str, type_name: str, payload: bytes, stamp_ns: int, log_ns: int) -> None:
        """Add a message to this vehicle's log; `topic` without the vehicle's name."""
        ...

    def event(self, line: str) -> None:
        """Add a warning to this vehicle's log."""
        ...

    def at_meetings(self, call: Callable[[int], None]) -> None:
        """Call this after each meeting, with the time in ns."""
        ...


@runtime_checkable
class Together(Protocol):
    """An experiment that several vehicles fly together.

    Each vehicle has an object of its own, in a process of its own.

    Attributes:
        vehicles_min, vehicles_max: how many vehicles can fly it.
    """

    vehicles_min: int
    vehicles_max: int

    def join(self, company: Company) -> None:
        """Take the place of one vehicle, before it flies."""
        ...

    def judge(self, logs: Mapping[str, Path], results: Mapping[str, Result]) -> Result:
        """Return the result of all vehicles together, from their logs and single results."""
        ...

    def start_places(self, count: int, seed: int) -> Sequence[tuple[float, float]]:
        """Return x and y (m) where each vehicle starts; none for quadlab's own places."""
        ...


@runtime_checkable
class ReportingTogether(Protocol):
    """An experiment of several vehicles that also writes a report of all."""

    def report_together(
        self, logs: Mapping[str, Path], results: Mapping[str, Result], joint: Result, folder: Path
    ) -> list[Path]:
        """Return the files written. Raises UsageError when a required package is not installed."""
        ...
