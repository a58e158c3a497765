"""`quadlab fly EXPERIMENT`: an experiment in simulated time, its log, verdict and metrics."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.commands.processes import File, Folder, Settings
from quadlab.data_folder import open_data_folder
from quadlab.settings import parse_settings
from quadlab.simulated.beacon_file import beacon_words
from quadrotor.errors import QuadlabError, UsageError

if TYPE_CHECKING:
    from console.experiments.client import Experiment, Result
    from console.experiments.readings import Progress
    from quadlab.simulated.flight import FlightParameters, SimulatedFlight
    from quadrotor.calibration_record import CalibrationRecord

LARGEST_SEED = 2**31 - 1 - 2_000_003
STATUS = {"passed": 0, "failed": 1, "not_judged": 3}
"""Exit status by verdict; 2 is a wrong word."""


@dataclass
class Fly:
    """Fly an experiment on the simulated vehicle, as fast as the processor goes."""

    experiment: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT")]
    """figure_eight, hover, bearings, gyroscope, accelerometer, motor_bench, mass, inertia, drag,
    vibration, tracker_delay, tracker_body; or FILE.py, an experiment of your own
    (docs/experiments.md)"""
    out: Folder = None
    """folder for the log (default: flights in the data folder)"""
    seed: int = 1
    """of all noise; the same seed gives the same messages"""
    set: Settings = ()
    """set a parameter; simulator.NAME, tracker.NAME and bearings.NAME for what is simulated,
    experiment.NAME for what is flown"""
    beacons: File = None
    """beacons of a CSV file with the header id,x,y,z (m); layouts by name with
    --set bearings.layout=NAME"""
    plugins: Folder = None
    """folder of control laws of your own (default: plugins in the data folder)"""
    true_state: bool = False
    """let the controller see the true state instead of the estimate"""
    report: bool = False
    """write the report (HTML and PDF) and the experiment's own plots beside the log"""
    json: bool = False
    """print verdict, log and metrics as one line of JSON at the end"""

    def run(self) -> int:
        from console.experiments import watched
        from console.experiments.user_file import mistakes_told

        experiment = chosen(self.experiment)
        if self.report:
            check_report()
        if not 0 <= self.seed <= LARGEST_SEED:
            raise UsageError(f"--seed {self.seed}: allowed 0 to {LARGEST_SEED}")

        from quadlab.simulated.flight import FlightParameters, SimulatedFlight, TrueState
        from quadlab.simulated.flight_log import FlightLog
        from quadrotor.parameters import ParameterStore
        from vehicle.flight.kernels import prepare
        from vehicle.processes.parent import PLUGINS
        from vehicle.simulator.simulated_vehicle import SimulatedVehicle
        from vehicle_link.messages import typestore

        parameters = with_experiment(FlightParameters().model_copy(deep=True), experiment)
        parameters.seed(self.seed)
        values = parse_settings(parameters, [*beacon_words(self.beacons), *self.set])
        if "beacons.layout" not in values:  # the vehicle is told where the beacons are
            parameters.beacons.layout = parameters.bearings.layout
        with mistakes_told(experiment):
            experiment.check()
        folder = self.out or open_data_folder(None) / "flights"
        path = _new_log(open_data_folder(folder, "--out"), f"{experiment.name}_seed{self.seed}")
        simulated = SimulatedVehicle(parameters.simulator)
        simulated.warm_up()
        log = FlightLog(
            path,
            "quad1",
            ParameterStore(parameters),
            {"run_id": path.stem, "experiment": experiment.name, "seed": str(self.seed)},
        )
        estimator = TrueState(simulated) if self.true_state else None
        # Everything that is loaded or compiled at its first use, so that the figures below are
        # of flying alone.
        _, later = prepare(lambda line: print(f"quadlab: {line}", file=sys.stderr, flush=True))
        typestore()
        plugins = self.plugins or open_data_folder(None) / PLUGINS
        flight = SimulatedFlight(parameters, simulated, log, estimator, plugins)
        if not self.json:
            flight.on_tell = Teller(flight)
        began, processor = time.perf_counter(), time.process_time()
        aborted = ""
        try:
            watched.fly(experiment, flight)
        except watched.AbortedError as error:
            aborted = str(error)
        except QuadlabError as error:
            raise kept(error, path) from error
        finally:
            log.close()
            later.close()
            flight.stack.steering.close()
        wall, processor = time.perf_counter() - began, time.process_time() - processor
        flown, rate = flight.view().time, parameters.simulator.imu_rate
        result, proposal = judged(experiment, path, aborted)

        if not self.json:
            reason = aborted or result.reason
            words = result.verdict.replace("_", " ")
            print(f"{experiment.name}: {words}{f' ({reason})' if reason else ''}")
        width = max(map(len, result.metrics), default=0)
        for name, value in result.metrics.items():
            limit = result.limits.get(name)
            bound = f"   (at most {limit:g})" if limit is not None else ""
            print(f"  {name:{width}} {value:10.5g}{bound}")
        print(f"  flown {flown:.1f} s in {wall:.2f} s: {flown / wall:.1f} times real time")
        for stage, seconds in sorted(flight.clock.seconds.items(), key=lambda s: -s[1]):
            a_tick = seconds / flown / rate * 1e6
            print(f"    {stage:16} {seconds:7.2f} s {seconds / wall:6.1%} {a_tick:7.1f} µs a tick")
        print(f"  log {path}")
        store = flight.stack.store
        if proposal is not None and not self.json:
            from quadlab.calibration.proposal_lines import proposal_lines

            print("\n".join(f"  {line}" for line in proposal_lines(proposal, store)))
        files = write_report(experiment, path, result, proposal) if self.report else []
        for file in files:
            print(f"  report {file}")
        if self.json:
            report = {
                "experiment": experiment.name,
                "verdict": result.verdict,
                "reason": aborted or result.reason,
                "log": str(path),
                "report": [str(file) for file in files],
                "metrics": result.metrics
                | {
                    "flown_s": flown,
                    "wall_s": wall,
                    "processor_s": processor,
                    "speed": flown / wall,
                },
            }
            if proposal is not None:
                from quadlab.calibration.proposal_lines import proposal_json

                report["proposal"] = proposal_json(proposal, store)
            print(json.dumps(report))
        return STATUS[result.verdict]


def chosen(name: str) -> Experiment:
    """Return a built-in experiment, or that of a file. Raises UsageError or StorageError."""
    from console.experiments.catalogue import EXPERIMENTS, find
    from console.experiments.user_file import is_file, load

    if is_file(name):
        return load(Path(name))
    if name not in EXPERIMENTS:
        raise UsageError(
            f"unknown experiment {name!r}; there are {', '.join(EXPERIMENTS)}, and files of your "
            "own: quadlab fly FILE.py"
        )
    return find(name)


def judged(
    experiment: Experiment, log: Path, aborted: str
) -> tuple[Result, CalibrationRecord | None]:
    """Return result and proposal from the log alone; of an aborted flight what there is of figures.

    Raises QuadlabError with the reason and where the log is.
    """
    from console.evaluation.verdict import evaluated
    from console.experiments.client import Calibrating, Result
    from console.experiments.user_file import mistakes_told

    try:
        with mistakes_told(experiment):
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
    """Return the same error, with where the log is."""
    return type(error)(f"{error}; the log is kept: {log}")


class Teller:
    """Prints the instructions of a guided procedure, each once."""

    def __init__(self, flight: SimulatedFlight) -> None:
        self._flight = flight
        self._last = ""

    def __call__(self, progress: Progress) -> None:
        if progress.instruction == self._last:
            return
        self._last = progress.instruction
        step = f"{progress.number}/{progress.count}" if progress.count else ""
        print(f"  {self._flight.view().time:7.1f} s {step:>6}  {progress.instruction}", flush=True)


def with_experiment(parameters: FlightParameters, experiment: Experiment) -> FlightParameters:
    """Return the tree with what can be chosen about the experiment, as `experiment.NAME`."""
    from pydantic import create_model

    options = experiment.parameters
    if options is None:
        return parameters
    tree = create_model(
        "ExperimentParameters", __base__=type(parameters), experiment=(type(options), options)
    )
    # Not copied: the experiment reads the very same object.
    return tree.model_construct(**dict(parameters), experiment=options)


def check_report() -> None:
    """Raise UsageError when no report can be written, before a flight is flown for it."""
    from importlib.util import find_spec

    try:
        found = find_spec("matplotlib") is not None
    except ValueError:  # shut out by whoever runs this
        found = False
    if not found:
        raise UsageError(
            "--report needs matplotlib, which is not installed: pip install matplotlib"
        )


def write_report(
    experiment: Experiment, log: Path, result: Result, proposal: CalibrationRecord | None
) -> list[Path]:
    """Write the page, the PDF and what the experiment itself writes, next to the log."""
    from console.experiments.client import Reporting
    from console.reports.report import write_report as write_pages
    from quadlab.log_commands.report import new_defaults

    files = write_pages(log, log.parent, result=result, proposal=proposal, defaults=new_defaults)
    if isinstance(experiment, Reporting):
        files += experiment.report(log, log.parent)
    return files


def _new_log(folder: Path, stem: str) -> Path:
    """Return a file name that is free: no earlier flight is overwritten."""
    path, number = folder / f"{stem}.mcap", 2
    while path.exists():
        path, number = folder / f"{stem}_{number}.mcap", number + 1
    return path
