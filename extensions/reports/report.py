"""Assembles and writes the report of a log: one HTML file and one PDF."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from console.atomic_file import replacing
from console.evaluation.findings import explain
from console.evaluation.result import Result
from console.plots import require_matplotlib
from console.reports.content import Block, Heading, Report, Text
from console.reports.flight import flight_of
from console.reports.judgement import Judgement, judge
from console.reports.run_log import RunLog, read_run
from console.reports.writer import Defaults
from extensions.reports import html
from extensions.reports.defaults import known_defaults
from extensions.reports.experiment_figures import experiment_pictures
from extensions.reports.explanation_figures import explanation_blocks
from extensions.reports.flight_figures import flight_pictures
from extensions.reports.log_tables import (
    parameter_blocks,
    recording_blocks,
    timeline_blocks,
    version_blocks,
)
from extensions.reports.tables import calibration_blocks, day, metrics_blocks, proposal_blocks
from flight_log.run_folder import log_of
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import StorageError

MARK = html.GENERATOR.encode()
"""Marker in every file written here, so that no other file is overwritten."""
NAMES = {"mass": "Mass estimation", "figure_eight": "Figure 8", "bearings": "Flight on bearings"}


def write_report(
    log: Path,
    folder: Path,
    *,
    pdf: bool = True,
    result: Result | None = None,
    proposal: CalibrationRecord | None = None,
    defaults: Defaults | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Path]:
    """Write `folder`/<name of the log>.html, and .pdf; earlier ones of this log are replaced.

    Args:
        result, proposal: of a flight that has just ended; otherwise result.json is used, or else
            the log is judged here.
        defaults: returns the parameters' defaults, for logs without them; None for those that the
            station knows.
        progress: called with the share that is done, 0 to 1.

    Raises:
        UsageError: matplotlib is not installed.
        StorageError: a file cannot be read or written, or the target is not a report.
        LogFormatError: the file is not a log, or it is empty.
    """
    require_matplotlib()
    targets = [folder / f"{log.stem}.{kind}" for kind in (("html", "pdf") if pdf else ("html",))]
    for target in targets:
        _check_ours(target)
    run = read_run(log)
    progress(0.3)
    report = assemble(run, result, defaults or known_defaults, proposal)
    progress(0.5)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(targets[0]) as path, path.open("w", encoding="utf-8") as file:
            file.writelines(html.render(report))
        progress(0.7 if pdf else 1.0)
        if pdf:
            from extensions.reports.pdf import write_pdf

            with replacing(targets[1]) as path:
                write_pdf(report, path)
    except OSError as error:
        why = error.strerror or str(error)
        raise StorageError(
            f"the report cannot be written to {folder}: {why}; try another folder"
        ) from error
    progress(1.0)
    return targets


def assemble(
    log: RunLog,
    result: Result | None,
    defaults: Defaults,
    proposal: CalibrationRecord | None = None,
) -> Report:
    """Assemble the content of the report; nothing is drawn yet."""
    findings = explain(log.topics, log.parameters)  # before `flight_of` frees columns
    flight = flight_of(log)
    judged = judge(log, flight, result, proposal)
    name = judged.experiment
    run_id = log.run.get("run_id") or log.path.stem
    title = f"{NAMES.get(name, name.replace('_', ' ').capitalize()) or 'Flight'}: {run_id}"
    found, missing = experiment_pictures(log, flight, judged)
    blocks: list[Block] = [Text(problem, warning=True) for problem in log.problems]
    if log.recovered:
        lost = log.recovered.get("lost_bytes", "?")
        blocks.append(
            Text(
                f"The file was torn and repaired: {lost} bytes after the tear are lost "
                f"({log.recovered.get('reason', '')}).",
                warning=True,
            )
        )
    blocks += [Text(text, warning=True) for text in missing]
    blocks += explanation_blocks(log, findings)
    figures = metrics_blocks(judged)
    blocks += [Heading("Result"), *figures] if figures else []
    blocks += proposal_blocks(judged, log.parameters)
    if found:
        blocks += [Heading("Figures of the paper" if name in PAPERS else "Figures"), *found]
    more = flight_pictures(log, flight, standing=name in STANDING)
    if more:
        blocks += [Heading("The flight" if name not in STANDING else "The vehicle"), *more]
    if not found and not more:
        blocks.append(
            Text(
                "Nothing can be drawn: the log has no state, truth, tracker_pose, actuators, "
                "estimator or battery topic.",
                warning=True,
            )
        )
    blocks += calibration_blocks(log)
    blocks += parameter_blocks(log, judged, defaults)
    blocks += timeline_blocks(log)
    blocks += recording_blocks(log)
    blocks += version_blocks(log)
    return Report(title, _subtitle(log), judged.verdict, judged.source, _facts(log, judged), blocks)


PAPERS = ("motor_bench", "mass", "figure_eight", "bearings")
STANDING = ("motor_bench", "accelerometer", "gyroscope")


def _subtitle(log: RunLog) -> str:
    when = _date(log) or f"file of {_written(log)}"
    return f"{log.vehicle or 'unknown vehicle'} · {when} · {_duration(log.duration)}"


def _facts(log: RunLog, judged: Judgement) -> list[tuple[str, str]]:
    count = sum(len(one.time) for one in log.topics.values())
    size = log_of(log.path).stat().st_size / 1e6
    recorder = log.run.get("recorder", "not recorded")
    facts = [
        ("Experiment", judged.experiment or "none"),
        ("Vehicle", log.vehicle or "not recorded"),
        ("Date", _date(log) or f"not recorded; the file is of {_written(log)}"),
        ("Duration", f"{log.duration:.1f} s"),
        ("Recorded by", {"simulation": "quadlab fly, simulated time"}.get(recorder, recorder)),
        ("Log", f"{log.path.name}, {size:.1f} MB, {count} messages"),
    ]
    for name in ("operator", "seed"):
        if log.run.get(name):
            facts.insert(4, (name.capitalize(), log.run[name]))
    return facts


def _date(log: RunLog) -> str:
    """Return the date of the log's first message; empty when its clock began at 0."""
    return day(log.start_ns) or log.run.get("started", "")[:16].replace("T", " ")


def _written(log: RunLog) -> str:
    return day(log_of(log.path).stat().st_mtime_ns)


def _duration(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole} s" if whole < 120 else f"{whole // 60} min {whole % 60} s"


def _check_ours(path: Path) -> None:
    """Raise StorageError when another file would be overwritten."""
    try:
        if path.exists() and (not path.is_file() or MARK not in path.read_bytes()):
            raise StorageError(
                f"{path} exists and is not a report of quadlab; move it away, or try --out FOLDER"
            )
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error
