"""`quadlab replay LOG`: runs other estimators, gains, beacons or noise over a recorded flight."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.data_folder import data_folder
from quadlab.log_commands.log_file import check_log_file
from quadlab.option_types import File, Flag, Names, Settings, optional
from quadlab.settings import beacon_words
from quadrotor.errors import LogFormatError, StorageError, UsageError

if TYPE_CHECKING:
    from extensions.offline.lines import Run
    from extensions.offline.measurements import MeasurementStore
    from extensions.offline.window import Window
    from quadlab.recording.errors import Truth
    from quadlab.recording.log import Recording

Runs = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="'NAME NAME=VALUE …'")
]
On = Annotated[
    Literal["auto", "bearings", "recorded-bearings", "poses", "both", "sweeps"],
    tyro.conf.arg(metavar="auto|bearings|recorded-bearings|poses|both|sweeps"),
]


@dataclass
class Replay:
    """Run estimators over the IMU, measurements and truth of a recorded flight, and compare them.

    Each run is a row of the table and a line of the plot. Without any, the flight's own estimator
    is replayed as it flew.
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]
    """log of `quadlab fly`, or one from the vehicle's folder onboard/"""
    estimator: Names = ()
    """run this estimator with the --set words"""
    run_words: Annotated[Runs, tyro.conf.arg(name="run")] = ()
    """a run with its own settings, in one pair of quotes; they apply after the --set words"""
    set: Settings = ()
    """set estimation.NAME, bearings.NAME or tracker.NAME in all runs (default: the flight's);
    estimation.preset=NAME sets the gains of a named set"""
    on: On = "auto"
    """measurements for the estimators: bearings emulated again from the truth, the recorded ones,
    the tracker's poses (emulated again if a tracker.NAME is set), poses and bearings, or the sweeps
    of Lighthouse base stations in an imported flight; auto: without --estimator and --run those of
    the flight, else the recorded bearings, or emulated ones if there are none or a bearings.NAME is
    set; estimation.source=… in a run takes precedence"""
    beacons: File = None
    """beacons of a CSV file with the header id,x,y,z (m); layouts by name
    with --set bearings.layout=NAME"""
    survey: Flag = False
    """first estimate the positions of the beacons (with sweeps: of the base stations) from the
    flight, and use them in all runs; with --on both they follow from the tracker's poses, with
    bearings alone from the IMU"""
    truth: Literal["recorded", "tracker"] = "recorded"
    """compare with, and emulate bearings from, the simulator's truth or the tracker's poses"""
    start: Annotated[float | None, optional("S", "from")] = None
    """compare from this time after the log's first sample (default: while airborne)"""
    end: Annotated[float | None, optional("S", "to")] = None
    """compare up to this time"""
    plot: File = None
    """draw the position errors over time"""
    csv: File = None
    """write the table"""
    json: Flag = False
    """print the table as one line of JSON at the end"""

    def run(self) -> int:
        self._check_words()
        from extensions.offline.lines import flown_choices, plan_runs
        from extensions.offline.measurements import MeasurementStore
        from extensions.offline.report import (
            as_json,
            draw,
            print_table,
            recorded_row,
            run_row,
            write_csv,
        )
        from extensions.offline.run import replay
        from extensions.offline.window import find_window
        from quadlab.recording.log import read_recording
        from vehicle.estimators.estimators import Estimators
        from vehicle.processes.config import PLUGINS

        Estimators(data_folder(None) / PLUGINS).register()
        settings = [*beacon_words(self.beacons), *self.set]
        recording = read_recording(self.file)
        truth = self._truth(recording)
        runs = plan_runs(
            recording,
            self.estimator,
            self.run_words,
            settings,
            None if self.on == "auto" else self.on,
        )
        window = find_window(recording, truth, self.start, self.end)
        store = MeasurementStore(recording, truth)
        surveyed = self._survey(recording, runs, store) if self.survey else []
        rows = [recorded_row(recording, truth, window)] if len(recording.state) else []
        for run in runs:
            replayed = replay(recording, run, store.of(run))
            rows.append(run_row(recording, truth, window, run, replayed))
        if self.plot is not None:
            draw(self.plot, recording, window, rows)
        if self.csv is not None:
            write_csv(self.csv, rows)
        self._print_head(recording, window, surveyed)
        print_table(rows)
        if len(flown := flown_choices(recording)) > 1:
            choices = (f"{one.estimator} on {one.source} {one.seconds:.1f} s" for one in flown)
            print(f"  the flight was flown on {', '.join(choices)}")
        for path in (self.plot, self.csv):
            if path is not None:
                print(f"  wrote {path}")
        if self.json:
            print(as_json(recording, self.truth, window, rows))
        return 0

    def _print_head(self, recording: Recording, window: Window, surveyed: list[str]) -> None:
        """Print what is compared with what, and the notes of log and survey."""
        start, end = recording.seconds(window.start_ns), recording.seconds(window.end_ns)
        print(
            f"{self.file.name}: {start:.2f} to {end:.2f} s ({window.found}), "
            f"errors against the {'truth' if self.truth == 'recorded' else 'tracker'}: rms and max"
        )
        if self.set or self.beacons:
            words = [*self.set, *([f"beacons of {self.beacons}"] if self.beacons else [])]
            print(f"set in all runs: {', '.join(words)}")
        for line in (*recording.notes, *surveyed):
            print(f"  {line}")

    def _check_words(self) -> None:
        """Raise the errors that can be found before the log is read."""
        check_log_file(self.file)
        if self.start is not None and self.end is not None and not self.start < self.end:
            raise UsageError(f"--from {self.start:g} --to {self.end:g}: the first must be earlier")
        for word, path in (("--plot", self.plot), ("--csv", self.csv)):
            if path is not None and not path.resolve().parent.is_dir():
                raise StorageError(f"{word} {path}: there is no folder {path.parent}; make it")
            if path is not None and path.resolve() == self.file.resolve():
                raise UsageError(f"{word} {path} is the log itself; name another file")
        if self.plot is not None:
            from extensions.offline.report import check_plot

            check_plot(self.plot)

    def _survey(self, recording: Recording, runs: list[Run], store: MeasurementStore) -> list[str]:
        """Find the positions of base stations or beacons for the runs; return lines about them."""
        from bearing_sim.beacons import format_layout
        from extensions.offline.lines import BELIEVED_LAYOUT, SWEEPS
        from extensions.offline.survey import survey_beacons, survey_stations

        run = next((run for run in runs if run.estimator == "error_state"), None)
        if run is None or run.source == "poses":
            raise UsageError(
                "--survey needs a run of error_state on bearings, both or sweeps; "
                "add --estimator error_state --on both"
            )
        print("surveying: the flight is replayed several hundred times", flush=True)
        if run.source == SWEEPS:
            return [f"base station {line}" for line in survey_stations(recording, run).lines]
        beacons, found = survey_beacons(recording, run, store.of(run))
        for one in runs:
            one.parameters.beacons.layout = format_layout(beacons)
            one.fixed |= {BELIEVED_LAYOUT}
        layout = f"in use from here on: --set 'beacons.layout={run.parameters.beacons.layout}'"
        return [*(f"beacon {line}" for line in found.lines), layout]

    def _truth(self, recording: Recording) -> Truth:
        from extensions.offline.window import tracked_truth, with_attitude
        from quadlab.recording.errors import Truth

        if self.truth == "tracker":
            if len(with_attitude(recording)) < 2:
                raise LogFormatError(f"{self.file} holds no tracker poses to compare with")
            return tracked_truth(recording)
        if len(recording.truth) < 2:
            hint = (
                "--truth tracker uses the tracker's poses instead"
                if with_attitude(recording)
                else "and no tracker poses either, so nothing can be compared"
            )
            raise LogFormatError(
                f"{self.file} holds no truth (topic /{recording.vehicle}/truth); {hint}"
            )
        return Truth(recording.truth_ns, recording.truth)
