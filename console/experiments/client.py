"""The actions of an experiment: the small client API behind simulation, page and real flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from console.evaluation import result
from console.experiments.readings import BenchReadings, ImuReadings, Progress, TrackedAttitude
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import QuadlabError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters

Result = result.Result


class VehicleView(NamedTuple):
    """The state of the vehicle in its newest telemetry."""

    time: float  # s, vehicle clock
    mode: str
    behavior: str
    armed: bool
    airborne: bool
    position_w: npt.NDArray[np.float64]  # (3,) m
    mass: float = float("nan")  # kg, estimated in flight
    mass_deviation: float = float("inf")  # kg, standard deviation of the estimate


class ExperimentEndedError(QuadlabError):
    """The experiment was stopped or a person took over: it may send no commands, not even land."""


class Client(Protocol):
    """The commands and waits of an experiment.

    Commands raise RefusedError with the vehicle's reason; waits raise RefusedError on timeout. On a
    real link all of them also raise ExperimentEndedError, or LinkError.
    """

    @property
    def finished(self) -> bool:
        """Return whether the manoeuvre should end now; conditions of waits may use it."""
        ...

    @property
    def has_pilot(self) -> bool:
        """Return whether a person could fly with sticks."""
        ...

    def pilot_flies(self, on: bool) -> None:
        """Start or stop forwarding the person's sticks. Raises UsageError without a person."""
        ...

    def view(self) -> VehicleView: ...

    def arm(self) -> None: ...

    def start(self, behavior: str, **arguments: ParameterValue) -> None: ...

    def change(self, values: dict[str, ParameterValue]) -> None:
        """Set vehicle parameters, all or none."""
        ...

    def parameter(self, name: str) -> ParameterValue:
        """Return the vehicle's present value. Raises UnknownParameterError."""
        ...

    def sticks(self, axes: Sequence[float]) -> None:
        """Send forward, left, up, yaw in -1..1, dead-man held; repeat it within 0.2 s."""
        ...

    def wait_until(
        self, condition: Callable[[VehicleView], bool], *, what: str, timeout: float
    ) -> None: ...

    def wait(self, seconds: float) -> None: ...

    # ------------------------------------------------------------------ guided procedures
    @property
    def simulated(self) -> bool:
        """Return whether the vehicle is simulated, and so turns by itself on command."""
        ...

    def tell(self, progress: Progress) -> None:
        """Show the person what to do, and the progress; cheap enough to call as often as needed."""
        ...

    def confirm(self, question: str) -> None:
        """Wait for a person's confirmation. Raises ExperimentEndedError when stopped instead."""
        ...

    def turn(self, quaternion_wb: Sequence[float] | None) -> None:
        """Hold a simulated vehicle in this attitude, or release it for None. No effect on a real
        one, where the instruction is for the person.
        """
        ...

    def imu(self) -> ImuReadings: ...

    def tracked(self) -> TrackedAttitude | None:
        """Return the tracked attitude; None when the tracker has not seen the vehicle for 0.1 s."""
        ...

    def calibrate_gyroscope(self) -> CalibrationRecord:
        """Let the vehicle measure its gyroscope drift again, with motors off, and wait for it."""
        ...

    def bench(self, motor: int, reference: int) -> None:
        """Turn one motor alone (1 front, 2 left, 3 rear, 4 right; 0 ends it) at a reference
        (counts).

        Call it on the ground, after `confirm`. The motor keeps turning while the experiment waits.
        A simulated vehicle is then fixed on a force/torque sensor under that motor.
        """
        ...

    def bench_readings(self) -> BenchReadings: ...


class Experiment(Protocol):
    """One experiment: `fly` commands the vehicle, `evaluate` judges from the log alone.

    `parameters` are its options, or None when it has none.
    """

    name: str

    @property
    def parameters(self) -> Parameters | None: ...

    @property
    def planned(self) -> float:
        """Return the approximate planned time of the flight in s."""
        ...

    def check(self) -> None:
        """Check the options before any command is sent. Raises UsageError or StorageError for
        inconsistent options or missing files.
        """
        ...

    def fly(self, client: Client) -> None: ...

    def evaluate(self, log: Path) -> Result: ...


@runtime_checkable
class Reporting(Protocol):
    """An experiment that also writes a report."""

    def report(self, log: Path, folder: Path) -> list[Path]:
        """Return the files written. Raises UsageError when a required package is not installed."""
        ...


@runtime_checkable
class Calibrating(Protocol):
    """An experiment whose result the vehicle may apply as a calibration."""

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the proposal from the log alone.

        Its run_id, requester and stamp are added when it is accepted. Raises MeasurementError with
        the reason when there is nothing to propose.
        """
        ...
