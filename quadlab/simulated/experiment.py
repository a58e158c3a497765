"""The flight of an experiment in simulated time, from its name to its verdict."""

from __future__ import annotations

import atexit
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from quadlab.data_folder import data_folder, open_data_folder
from quadlab.settings import parse_settings
from quadlab.vehicle_names import THE_VEHICLE
from quadrotor.errors import QuadlabError, UsageError
from quadrotor.similar_names import did_you_mean

if TYPE_CHECKING:
    from console.experiments.client import Experiment, Result
    from console.experiments.readings import Progress
    from quadlab.simulated.flight import SimulatedFlight
    from quadlab.simulated.member import Member
    from quadlab.simulated.parameters import FlightParameters
    from quadrotor.calibration_record import CalibrationRecord
    from vehicle.boards.kind import Kind
    from vehicle.flight.kernels import BackgroundParts
    from vehicle.simulator.simulated_vehicle import SimulatedVehicle

LARGEST_SEED = 2**31 - 1 - 2_000_003


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight that has ended.

    Attributes:
        path: its log. aborted: why it ended early, empty if it did not.
        wall, processor: duration of the flight in s, without loading and compiling before it.
    """

    flight: SimulatedFlight
    path: Path
    result: Result
    proposal: CalibrationRecord | None
    aborted: str
    wall: float
    processor: float


def fly(
    experiment: Experiment,
    *,
    seed: int = 1,
    words: Sequence[str] = (),
    out: Path | None = None,
    plugins: Path | None = None,
    board: str = "mikrokopter",
    true_state: bool = False,
    print_instructions: bool = False,
    member: Member | None = None,
) -> Flown:
    """Fly an experiment on the simulated vehicle and judge its log.

    Args:
        seed: seed of all noise. words: NAME=VALUE of parameters. out: folder of the log; None:
            flights in the data folder. plugins: folder of users' laws and estimators. true_state:
            whether the controller gets the true state. print_instructions: whether instructions of
            a guided procedure are printed. member: the vehicle's place among several that fly
            together.

    Raises QuadlabError; after the start, its message includes the path of the log.
    """
    from console.experiments.user_file import errors_with_line
    from vehicle.boards.kind import find_kind
    from vehicle.estimators.offer import offer_plugins
    from vehicle.processes.config import PLUGINS

    check_seed(seed)
    kind = find_kind(board)
    plugins = plugins or data_folder(None) / PLUGINS
    offer_plugins(plugins)
    parameters = flight_parameters(experiment, kind, seed, words)
    with errors_with_line(experiment):
        experiment.check()
    path, vehicle = _own_log(experiment, seed, out) if member is None else (member.log, member.name)
    facts = {"run_id": path.stem, "experiment": experiment.name, "seed": str(seed), "board": board}
    made, log = getattr(experiment, "flight", None), (path, vehicle, facts)
    flight = _new_flight(parameters, kind, plugins, log, true_state, member, made=made)
    if print_instructions:
        flight.on_progress = InstructionPrinter(flight)
    began, processor = time.perf_counter(), time.process_time()
    try:
        aborted = (member.fly if member is not None else _flown)(experiment, flight)
    except QuadlabError as error:
        raise kept(error, path) from error
    finally:
        flight.close()
    took = {"wall": time.perf_counter() - began, "processor": time.process_time() - processor}
    result, proposal = judged(experiment, path, aborted)
    return Flown(flight, path, result, proposal, aborted, **took)


def _new_flight(
    parameters: FlightParameters,
    kind: Kind,
    plugins: Path,
    log: tuple[Path, str, dict[str, str]],
    true_state: bool,
    member: Member | None,
    *,
    made: type[SimulatedFlight] | None,
) -> SimulatedFlight:
    """Return the flight, of the experiment's own kind if it has one, with its simulated vehicle and
    its log (path, vehicle, facts).
    """
    from quadlab.simulated.flight import SimulatedFlight, TrueState
    from quadlab.simulated.flight_log import FlightLog
    from quadrotor.parameters import ParameterStore

    path, vehicle, facts = log
    simulated = _simulated_vehicle(parameters, facts["board"])
    written = FlightLog(path, vehicle, ParameterStore(parameters), facts)
    neighbours = member.neighbours(simulated, written) if member is not None else None
    estimator = TrueState(simulated) if true_state else None
    load_kernels()
    kind_of = made or SimulatedFlight
    return kind_of(parameters, simulated, written, estimator, plugins, kind, neighbours=neighbours)


def check_seed(seed: int) -> None:
    """Raise UsageError for a seed that is not possible."""
    if not 0 <= seed <= LARGEST_SEED:
        raise UsageError(f"--seed {seed}: allowed 0 to {LARGEST_SEED}")


def alone(experiment: Experiment) -> None:
    """Raise UsageError for an experiment that one vehicle alone cannot fly."""
    from console.experiments.together import Together

    if isinstance(experiment, Together):
        raise UsageError(
            f"{experiment.name} is flown by several vehicles together; add --vehicles "
            f"{experiment.vehicles_min}, or more"
        )


@lru_cache(maxsize=1)
def load_kernels() -> BackgroundParts:
    """Load or compile everything that is needed, so that measured times contain the flight alone.

    A copy of a process that has loaded it has it, too. What still compiles is returned: it has to
    stay referred to, as a copy must not close its files.
    """
    from vehicle.flight.kernels import prepare
    from vehicle_link.messages import typestore

    _, later = prepare(lambda line: print(f"quadlab: {line}", file=sys.stderr, flush=True))
    atexit.register(later.close)
    typestore()
    return later


def flight_parameters(
    experiment: Experiment, kind: Kind, seed: int, words: Sequence[str]
) -> FlightParameters:
    """Return the parameters of the flight. Raises QuadlabError."""
    from quadlab.simulated.parameters import with_groups
    from quadlab.simulated.sensors import new_flight_parameters
    from quadrotor.parameters import ParameterStore

    parameters = with_groups(
        new_flight_parameters(),
        {"experiment": experiment.parameters, "board": kind.options() if kind.options else None},
    )
    ParameterStore(parameters).preset(kind.simulated_parameters)
    parameters.seed(seed)
    values = parse_settings(parameters, words)
    if "beacons.layout" not in values:  # the vehicle gets the true layout
        parameters.beacons.layout = parameters.bearings.layout
    return parameters


def _simulated_vehicle(parameters: FlightParameters, board: str) -> SimulatedVehicle:
    from vehicle.simulator.boards import firmware_of
    from vehicle.simulator.simulated_vehicle import SimulatedVehicle

    firmware = firmware_of(board, getattr(parameters, "board", None))
    simulated = SimulatedVehicle(parameters.simulator, firmware=firmware)
    simulated.warm_up()
    return simulated


def _flown(experiment: Experiment, flight: SimulatedFlight) -> str:
    """Fly; return why the experiment ended early, empty if it did not."""
    from console.experiments import watched

    try:
        watched.fly(experiment, flight)
    except watched.AbortedError as error:
        return str(error)
    return ""


def chosen(name: str, vehicle: str = THE_VEHICLE) -> Experiment:
    """Return a built-in experiment, or one from a file. Raises UsageError or StorageError."""
    from console.experiments.catalogue import experiments, find
    from console.experiments.user_file import GROUP, is_file, load
    from quadrotor.packaged_files import packaged_files

    if is_file(name):
        return load(Path(name), vehicle)
    if name not in experiments():
        packaged = packaged_files(GROUP)
        if name in packaged:
            return load(packaged[name], vehicle)
        known = *experiments(), *packaged
        raise UsageError(
            f"unknown experiment {name!r}; {did_you_mean(name, known, after=' ')}known are "
            f"{', '.join(known)}, and your own files: quadlab fly FILE.py"
        )
    return find(name, vehicle)


def judged(
    experiment: Experiment, log: Path, aborted: str
) -> tuple[Result, CalibrationRecord | None]:
    """Return result and proposal, from the log alone; for an aborted flight, the available figures.

    Raises QuadlabError with the reason and the path of the log.
    """
    from console.evaluation.verdict import evaluated
    from console.experiments.client import Calibrating, Result
    from console.experiments.user_file import errors_with_line

    try:
        with errors_with_line(experiment):
            result = evaluated(experiment, log)
            if aborted:
                return Result("failed", result.metrics, result.limits), None
            if isinstance(experiment, Calibrating):
                return result, experiment.proposal(log)
            return result, None
    except QuadlabError as error:
        if aborted:
            return Result("failed", {}), None
        raise kept(error, log) from error


def kept(error: QuadlabError, log: Path) -> QuadlabError:
    """Return the same error with the path of the log in its message."""
    return type(error)(f"{error}; the log is kept: {log}")


class InstructionPrinter:
    """Printer of the instructions of a guided procedure, each once."""

    def __init__(self, flight: SimulatedFlight) -> None:
        self._flight = flight
        self._last = ""

    def __call__(self, progress: Progress) -> None:
        if progress.instruction == self._last:
            return
        self._last = progress.instruction
        step = f"{progress.number}/{progress.count}" if progress.count else ""
        print(f"  {self._flight.view().time:7.1f} s {step:>6}  {progress.instruction}", flush=True)


def _own_log(experiment: Experiment, seed: int, out: Path | None) -> tuple[Path, str]:
    """Return the log and the vehicle of a flight for itself. Raises QuadlabError."""
    alone(experiment)
    folder = open_data_folder(out or open_data_folder(None) / "flights", "--out")
    return _new_log(folder, f"{experiment.name}_seed{seed}"), THE_VEHICLE


def _new_log(folder: Path, stem: str) -> Path:
    """Return a file name that is free, so that no earlier flight is overwritten."""
    path, number = folder / f"{stem}.mcap", 2
    while path.exists():
        path, number = folder / f"{stem}_{number}.mcap", number + 1
    return path
