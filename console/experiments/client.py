"""What an experiment may do: the small client API behind simulation, page and real flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from quadrotor.parameters import ParameterValue


@dataclass(frozen=True, slots=True)
class VehicleView:
    """The vehicle as its newest telemetry shows it."""

    time: float  # s, vehicle clock
    mode: str
    behavior: str
    armed: bool
    airborne: bool
    position_w: npt.NDArray[np.float64]  # (3,) m


class Client(Protocol):
    """Commands raise RefusedError with the vehicle's reason; waits raise RefusedError at the end
    of their time."""

    def view(self) -> VehicleView: ...

    def arm(self) -> None: ...

    def start(self, behavior: str, **arguments: ParameterValue) -> None: ...

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
    """One experiment: `fly` commands the vehicle, `evaluate` judges the log alone."""

    name: str

    def fly(self, client: Client) -> None: ...

    def evaluate(self, log: Path) -> Result: ...
