"""`quadlab fly EXPERIMENT`: flies an experiment in simulated time; log, verdict and metrics."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from console.experiments.catalogue import experiments
from quadlab.option_types import File, Flag, Folder, Settings
from quadlab.settings import beacon_words
from quadrotor.json_object import JsonObject

if TYPE_CHECKING:
    from console.experiments.client import Experiment, Result
    from quadlab.simulated.experiment import Flown
    from quadlab.simulated.together import FlownTogether
    from quadrotor.calibration_record import CalibrationRecord

EXPERIMENT = (
    f"{', '.join(experiments())}; or FILE.py, an experiment of your own (docs/experiments.md)"
)
STATUS = {"passed": 0, "failed": 1, "not_judged": 3}
"""Exit status by verdict; 2 means wrong usage."""


@dataclass
class Fly:
    """Fly an experiment on the simulated vehicle, as fast as the processor goes."""

    experiment: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT", help=EXPERIMENT)
    ]
    out: Folder = None
    """folder for the log (default: flights in the data folder)"""
    seed: int = 1
    """seed of all simulated noise; the same seed gives the same messages"""
    vehicles: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """vehicles that fly it at the same time, 1 to 8: quad1, quad2, …; each has its own log in one
    folder"""
    board: str = "mikrokopter"
    """the vehicle's board: mikrokopter; betaflight, whose real firmware flies (scripts/betaflight
    builds it); crazyflie, a simulated one"""
    set: Settings = ()
    """set a parameter; simulator.NAME, tracker.NAME and bearings.NAME for what is simulated,
    faults=TEXT for faults with schedules (docs/how_to/faults.md), experiment.NAME for what is
    flown"""
    beacons: File = None
    """beacons of a CSV file with the header id,x,y,z (m); layouts by name
    with --set bearings.layout=NAME"""
    plugins: Folder = None
    """folder of your own control laws and estimators (default: plugins in the data folder)"""
    true_state: Flag = False
    """let the controller see the true state instead of the estimate"""
    report: Flag = False
    """write the report (HTML and PDF) and the experiment's own plots next to the log"""
    json: Flag = False
    """print verdict, log and metrics as one line of JSON at the end"""

    def run(self) -> int:
        if self.report:  # before the flight
            from console.plots import require_matplotlib
            from console.reports.writer import report_writer

            require_matplotlib()
            report_writer()
        if self.vehicles != 1:
            return self._fly_together()
        from quadlab.simulated.experiment import chosen, fly
        from quadlab.simulated.parameters import faults_to_come

        experiment = chosen(self.experiment)
        done = fly(
            experiment,
            seed=self.seed,
            words=[*beacon_words(self.beacons), *self.set],
            out=self.out,
            plugins=self.plugins,
            board=self.board,
            true_state=self.true_state,
            print_instructions=not self.json,
        )
        result, proposal = done.result, done.proposal
        if not self.json:
            reason = done.aborted or result.reason
            words = result.verdict.replace("_", " ")
            print(f"{experiment.name}: {words}{f' ({reason})' if reason else ''}")
        _print_metrics(result.metrics, result.limits)
        for fault in faults_to_come(done.flight.parameters, done.flight.view().time):
            print(f"  never came on: {fault}; the flight ended before")
        _print_pace(done)
        print(f"  log {done.path}")
        if proposal is not None and not self.json:
            from quadlab.calibration.lines import proposal_lines

            lines = proposal_lines(proposal, done.flight.stack.store)
            print("\n".join(f"  {line}" for line in lines))
        files = write_report(experiment, done.path, result, proposal) if self.report else []
        for file in files:
            print(f"  report {file}")
        if self.json:
            print(json.dumps(_as_json(experiment.name, done, files)))
        return STATUS[result.verdict]

    def _fly_together(self) -> int:
        from quadlab.simulated.together import fly_together

        done = fly_together(
            self.experiment,
            self.vehicles,
            seed=self.seed,
            words=[*beacon_words(self.beacons), *self.set],
            out=self.out,
            plugins=self.plugins,
            board=self.board,
            true_state=self.true_state,
        )
        files = write_reports(done) if self.report else []
        if self.json:
            print(json.dumps(_together_json(self.experiment, done, files)))
            return STATUS[done.verdict]
        reason = f" ({done.reason})" if done.reason else ""
        print(f"{self.experiment} x {self.vehicles}: {done.verdict.replace('_', ' ')}{reason}")
        _print_metrics(done.metrics, done.limits)
        for name, answer in done.answers.items():
            print(f"  {name}: {answer.verdict.replace('_', ' ')}, log {done.logs[name]}")
        print("".join(f"  report {file}\n" for file in files), end="")
        speed = done.flown / done.wall
        print(f"  flown {done.flown:.1f} s in {done.wall:.2f} s: {speed:.1f} times real time")
        return STATUS[done.verdict]


def _together_json(experiment: str, done: FlownTogether, files: Sequence[Path]) -> JsonObject:
    flown = {"flown_s": done.flown, "wall_s": done.wall, "processor_s": done.processor}
    return {
        "experiment": experiment,
        "verdict": done.verdict,
        "reason": done.reason,
        "folder": str(done.folder),
        "report": [str(file) for file in files],
        "metrics": done.metrics | flown | {"speed": done.flown / done.wall},
        "vehicles": {
            name: {"log": str(done.logs[name]), **asdict(answer)}
            for name, answer in done.answers.items()
        },
    }


def _print_pace(done: Flown) -> None:
    """Print how fast the flight was, and where the time went."""
    flown, wall = done.flight.view().time, done.wall
    rate = done.flight.parameters.simulator.imu_rate
    print(f"  flown {flown:.1f} s in {wall:.2f} s: {flown / wall:.1f} times real time")
    for stage, seconds in sorted(done.flight.clock.seconds.items(), key=lambda s: -s[1]):
        a_tick = seconds / flown / rate * 1e6
        print(f"    {stage:16} {seconds:7.2f} s {seconds / wall:6.1%} {a_tick:7.1f} µs a tick")


def _as_json(experiment: str, done: Flown, files: Sequence[Path]) -> JsonObject:
    """Return verdict, log, report, metrics and proposal of a flight."""
    from quadlab.calibration.lines import proposal_json

    flown, proposal = done.flight.view().time, done.proposal
    pace = {"flown_s": flown, "wall_s": done.wall, "processor_s": done.processor}
    return {
        "experiment": experiment,
        "verdict": done.result.verdict,
        "reason": done.aborted or done.result.reason,
        "log": str(done.path),
        "report": [str(file) for file in files],
        "metrics": done.result.metrics | pace | {"speed": flown / done.wall},
        **({"proposal": proposal_json(proposal, done.flight.stack.store)} if proposal else {}),
    }


def _print_metrics(metrics: Mapping[str, float], limits: Mapping[str, float]) -> None:
    width = max(map(len, metrics), default=0)
    for name, value in metrics.items():
        limit = limits.get(name)
        bound = f"   (at most {limit:g})" if limit is not None else ""
        print(f"  {name:{width}} {value:10.5g}{bound}")


def write_report(
    experiment: Experiment, log: Path, result: Result, proposal: CalibrationRecord | None
) -> list[Path]:
    """Write the page, the PDF and the experiment's own files next to the log."""
    from console.experiments.client import Reporting
    from console.reports.writer import report_writer
    from quadlab.simulated.sensors import new_defaults

    write = report_writer()
    files = write(log, log.parent, result=result, proposal=proposal, defaults=new_defaults)
    if isinstance(experiment, Reporting):
        files += experiment.report(log, log.parent)
    return files


def write_reports(done: FlownTogether) -> list[Path]:
    """Write a report of each vehicle next to its log, and the experiment's own report of all."""
    from console.evaluation.result import Result
    from console.experiments.together import ReportingTogether
    from console.reports.writer import report_writer
    from quadlab.simulated.sensors import new_defaults

    write, files = report_writer(), list[Path]()
    results = {name: one.result for name, one in done.answers.items()}
    for name, log in done.logs.items():
        files += write(log, log.parent, result=results[name], proposal=None, defaults=new_defaults)
    if isinstance(done.experiment, ReportingTogether):
        joint = Result(done.verdict, done.metrics, done.limits, done.reason)
        files += done.experiment.report_together(done.logs, results, joint, done.folder)
    return files
