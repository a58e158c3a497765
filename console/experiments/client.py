"""What an experiment may do: the small client API behind simulation, page and real flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from quadrotor.errors import QuadlabError
from quadrotor.parameters import Parameters, ParameterValue


@dataclass(frozen=True, slots=True)
class VehicleView:
    """The vehicle as its newest telemetry shows it."""

    time: float  # s, vehicle clock
    mode: str
    behavior: str
    armed: bool
    airborne: bool
    position_w: npt.NDArray[np.float64]  # (3,) m


class ExperimentEndedError(QuadlabError):
    """Stopped, or somebody took over: the experiment may command no more, landing included."""


class Client(Protocol):
    """Commands raise RefusedError with the vehicle's reason; waits raise RefusedError at the end
    of their time. On a real link all of them also raise ExperimentEndedError, or LinkError."""

    @property
    def finished(self) -> bool:
        """Whether the manoeuvre is to end now; conditions of waits may look at it."""
        ...

    @property
    def has_pilot(self) -> bool:
        """Whether a person could fly with sticks."""
        ...

    def pilot_flies(self, on: bool) -> None:
        """Let the person's sticks through, or take them back. Raises UsageError without one."""
        ...

    def view(self) -> VehicleView: ...

    def arm(self) -> None: ...

    def start(self, behavior: str, **arguments: ParameterValue) -> None: ...

    def change(self, values: dict[str, ParameterValue]) -> None:
        """Set vehicle parameters, all or none."""
        ...

    def parameter(self, name: str) -> ParameterValue:
        """The vehicle's present value. Raises UnknownParameterError."""
        ...

    def sticks(self, axes: Sequence[float]) -> None:
        """Forward, left, up, yaw in -1..1, dead-man held; to be sent again within 0.2 s."""
        ...

    def wait_until(
        self, condition: Callable[[VehicleView], bool], *, what: str, timeout: float
    ) -> None: ...

    def wait(self, seconds: float) -> None: ...


@dataclass(slots=True)
class Result:
    """What came of an experiment: verdict "passed" or "failed", and named metrics in SI units."""

    verdict: str
    metrics: dict[str, float]
    limits: dict[str, float] = field(default_factory=dict)


class Experiment(Protocol):
    """One experiment: `fly` commands the vehicle, `evaluate` judges the log alone.

    `parameters` is what can be chosen about it, None when nothing can.
    """

    name: str

    @property
    def parameters(self) -> Parameters | None: ...

    @property
    def planned(self) -> float:
        """s that the flight takes, about."""
        ...

    def check(self) -> None:
        """Before anything is commanded. Raises UsageError or StorageError for options that do
        not go together or name what is not there."""
        ...

    def fly(self, client: Client) -> None: ...

    def evaluate(self, log: Path) -> Result: ...


@runtime_checkable
class Reporting(Protocol):
    """An experiment that also writes what it found."""

    def report(self, log: Path, folder: Path) -> list[Path]:
        """The files written. Raises UsageError when something for it is not installed."""
        ...
