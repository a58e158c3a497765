"""`quadlab fly EXPERIMENT`: an experiment in simulated time, its log, verdict and metrics."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.beacon_words import beacon_words
from quadlab.data_folder import open_data_folder
from quadlab.processes import File, Folder, Settings
from quadlab.settings import parse_settings
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from console.experiments.client import Experiment
    from quadlab.simulated_flight import FlightParameters

LARGEST_SEED = 2**31 - 1 - 2_000_003


@dataclass
class Fly:
    """Fly an experiment on the simulated vehicle, as fast as the processor goes."""

    experiment: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT")]
    """figure_eight, hover or bearings"""
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
    true_state: bool = False
    """let the controller see the true state instead of the estimate"""
    report: bool = False
    """write the experiment's plots and figures beside the log"""
    json: bool = False
    """print verdict, log and metrics as one line of JSON at the end"""

    def run(self) -> int:
        from console.experiments.catalogue import find

        experiment = find(self.experiment)
        if self.report:
            check_report(experiment)
        if not 0 <= self.seed <= LARGEST_SEED:
            raise UsageError(f"--seed {self.seed}: allowed 0 to {LARGEST_SEED}")

        from quadlab.flight_log import FlightLog
        from quadlab.simulated_flight import FlightParameters, SimulatedFlight, TrueState
        from quadrotor.parameters import ParameterStore
        from vehicle.kernels import prepare
        from vehicle.simulator.simulated_vehicle import SimulatedVehicle
        from vehicle_link.messages import typestore

        parameters = with_experiment(FlightParameters().model_copy(deep=True), experiment)
        parameters.seed(self.seed)
        values = parse_settings(parameters, [*beacon_words(self.beacons), *self.set])
        if "beacons.layout" not in values:  # the vehicle is told where the beacons stand
            parameters.beacons.layout = parameters.bearings.layout
        folder = self.out or open_data_folder(None) / "flights"
        path = _new_log(open_data_folder(folder, "--out"), f"{self.experiment}_seed{self.seed}")
        simulated = SimulatedVehicle(parameters.simulator)
        simulated.warm_up()
        log = FlightLog(
            path, "quad1", ParameterStore(parameters),
            {"run_id": path.stem, "experiment": self.experiment, "seed": str(self.seed)},
        )  # fmt: skip
        estimator = TrueState(simulated) if self.true_state else None
        # Everything that is loaded or compiled at its first use, so that the figures below are
        # of flying alone.
        _, later = prepare(lambda line: print(f"quadlab: {line}", file=sys.stderr, flush=True))
        typestore()
        flight = SimulatedFlight(parameters, simulated, log, estimator)
        began, processor = time.perf_counter(), time.process_time()
        try:
            experiment.fly(flight)
        finally:
            log.close()
            later.close()
        wall, processor = time.perf_counter() - began, time.process_time() - processor
        flown, rate = flight.view().time, parameters.simulator.imu_rate
        result = experiment.evaluate(path)

        if not self.json:
            print(f"{self.experiment}: {result.verdict}")
        for name, value in result.metrics.items():
            limit = result.limits.get(name)
            bound = f"   (at most {limit:g})" if limit is not None else ""
            print(f"  {name:18} {value:10.5g}{bound}")
        print(f"  flown {flown:.1f} s in {wall:.2f} s: {flown / wall:.1f} times real time")
        for stage, seconds in sorted(flight.clock.seconds.items(), key=lambda s: -s[1]):
            a_tick = seconds / flown / rate * 1e6
            print(f"    {stage:16} {seconds:7.2f} s {seconds / wall:6.1%} {a_tick:7.1f} µs a tick")
        print(f"  log {path}")
        files = write_report(experiment, path) if self.report else []
        for file in files:
            print(f"  report {file}")
        if self.json:
            report = {
                "experiment": self.experiment,
                "verdict": result.verdict,
                "log": str(path),
                "report": [str(file) for file in files],
                "metrics": result.metrics
                | {"flown_s": flown, "wall_s": wall, "processor_s": processor,
                   "speed": flown / wall},
            }  # fmt: skip
            print(json.dumps(report))
        return 0 if result.verdict == "passed" else 1


def with_experiment(parameters: FlightParameters, experiment: Experiment) -> FlightParameters:
    """The tree with what can be chosen about the experiment, as `experiment.NAME`."""
    from pydantic import create_model

    options = experiment.parameters
    if options is None:
        return parameters
    tree = create_model(
        "ExperimentParameters", __base__=type(parameters), experiment=(type(options), options)
    )
    # Not copied: the experiment reads the very same object.
    return tree.model_construct(**dict(parameters), experiment=options)


def check_report(experiment: Experiment) -> None:
    """Raises UsageError when no report can be written, before a flight is flown for it."""
    from importlib.util import find_spec

    from console.experiments.client import Reporting

    if not isinstance(experiment, Reporting):
        raise UsageError(f"--report: the experiment {experiment.name} writes none")
    try:
        found = find_spec("matplotlib") is not None
    except ValueError:  # shut out by whoever runs this
        found = False
    if not found:
        raise UsageError(
            "--report needs matplotlib, which is not installed: pip install matplotlib"
        )


def write_report(experiment: Experiment, log: Path) -> list[Path]:
    """The files, beside the log."""
    from console.experiments.client import Reporting

    return experiment.report(log, log.parent) if isinstance(experiment, Reporting) else []


def _new_log(folder: Path, stem: str) -> Path:
    """A file name that is free: no earlier flight is overwritten."""
    path, number = folder / f"{stem}.mcap", 2
    while path.exists():
        path, number = folder / f"{stem}_{number}.mcap", number + 1
    return path
