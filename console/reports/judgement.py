"""The judgement of a run: from its result.json, else by its experiment, else none."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from console.evaluation.findings import AT_BOUND, flagged, within
from console.evaluation.result import NOT_JUDGED, VERDICTS, Result
from console.evaluation.verdict import evaluated, judged
from console.experiments.catalogue import experiments, find
from console.experiments.client import Calibrating, Experiment
from console.experiments.figure_eight import LIMITS as EIGHT_LIMITS
from console.experiments.figure_eight import REST_TO_REST, STEADY
from console.experiments.hover import Hover
from console.reports.bench_steps import law_figures
from console.reports.flight import Flight, airborne, rms
from console.reports.run_log import RunLog
from console.runs.report_folders import has_report, read_result
from flight_log.fields import MOTOR_REFERENCES
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import QuadlabError, UsageError

Spans = list[tuple[float, float]]

WINDOWS = {
    ("figure_eight", STEADY): ("follow_trajectory", 4.0, 4.0),
    ("figure_eight", REST_TO_REST): ("follow_trajectory", 0.0, 0.0),
    ("hover", ""): ("hover", 2.0, 0.0),
}
"""Experiment and its kind of laps → judged behavior, and s excluded at its start and end."""
LIMITS = {("hover", ""): Hover.limits, **{("figure_eight", k): v for k, v in EIGHT_LIMITS.items()}}
"""Limits by experiment and kind of laps, for logs that the experiment itself cannot judge here."""
FLOWN = ("gyroscope", "accelerometer", "motor_bench")
"""Experiments judged only by the process that flew them: the log lacks the times of the steps."""
TOPICS = {"bench_reading": "motor_bench"}
"""The experiment of a log without one in its metadata, guessed from its topics."""


@dataclass
class Judgement:
    """The verdict and the figures of one run.

    Attributes:
        verdict: passed, failed, not_judged or empty.
        source: what judged the run, or why it was not judged.
        metrics, limits: by name, SI units and degrees.
        flight: figures of any flight, by name, with units in the name.
        windows: the judged intervals, s since the log's first message; empty when unknown.
    """

    experiment: str
    verdict: str = ""
    source: str = ""
    metrics: dict[str, float] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    options: dict[str, object] = field(default_factory=dict)
    flight: dict[str, float] = field(default_factory=dict)
    windows: Spans = field(default_factory=list)
    proposal: CalibrationRecord | None = None
    decision: str = ""

    @property
    def kind(self) -> tuple[str, str]:
        """Return the experiment's name and, for an 8, the kind of laps."""
        default = STEADY if self.experiment == "figure_eight" else ""
        return self.experiment, str(self.options.get("laps", default))


def experiment_of(log: RunLog) -> str:
    """Return the experiment's name; empty when the log is not from an experiment."""
    if name := log.run.get("experiment", ""):
        return name
    if has_report(log.path):
        try:
            if name := str(read_result(log.path).get("experiment", "")):
                return name
        except QuadlabError:
            pass
    if name := log.experiment_text("name"):
        return name
    return next((kind for topic, kind in TOPICS.items() if log.has(topic)), "")


def judge(
    log: RunLog,
    flight: Flight,
    result: Result | None = None,
    proposal: CalibrationRecord | None = None,
) -> Judgement:
    """Judge a log; `result` and `proposal` come from a flight just made. Never raises."""
    out = Judgement(experiment_of(log))
    out.options = {
        name.removeprefix("experiment."): value
        for name, value in log.parameters.items()
        if name.startswith("experiment.")
    }
    if has_report(log.path):
        _stored(log, out)
    out.windows = windows_of(log, out)
    out.flight = flight_figures(log, flight, out.windows)
    if out.experiment == "motor_bench" and log.has("bench_reading", "actuators"):
        with suppress(QuadlabError):  # the figure shows why there is no fit
            out.flight = law_figures(log)
    experiment = _made(log, out)
    if result is not None:
        _taken(out, result, "judged after the flight")
    elif out.source:
        pass
    elif out.experiment in FLOWN:
        out.source = (
            "there is no result.json next to the log; the process that flies the "
            "experiment judges it (quadlab fly --report, or the station)"
        )
    elif experiment is not None:
        _evaluated(log, out, experiment)
    elif out.experiment:
        out.source = f"{out.experiment} is not an experiment of this installation"
    else:
        out.source = "the log is not of an experiment"
    out.proposal = proposal or out.proposal
    _proposed(log, out, experiment)
    return out


def windows_of(log: RunLog, judged: Judgement) -> Spans:
    """Return the judged intervals as far as the log alone shows them."""
    if judged.experiment == "bearings":
        changes = log.topics.get("parameter_changes")
        begins = [
            (line.time, line.text.endswith("→ 'bearings'"))
            for line in log.lines
            if line.kind == "parameter" and line.text.startswith("estimation.source:")
        ]
        start = next((time for time, on in begins if on), None)
        if changes is None or start is None:
            return []
        end = next((t for t, on in begins if not on and t > start), log.duration)
        return [(start, end)]
    if judged.kind not in WINDOWS:
        return []
    behavior, before, after = WINDOWS[judged.kind]
    spans = [
        (start + before, end - after)
        for start, end, name in log.spans("status", "behavior")
        if name == behavior and end - start > before + after + 0.5
    ]
    return [max(spans, key=lambda span: span[1] - span[0])] if spans else []


def flight_figures(log: RunLog, flight: Flight, windows: Spans) -> dict[str, float]:
    """Return the figures of any flight, in the windows, or else while airborne."""
    spans = windows or airborne(log)
    found: dict[str, float] = {}
    if flight.shown is not None and spans:
        error, yaw = flight.tracking_error
        rows = within(flight.shown.time, spans)
        distance = np.linalg.norm(error[rows], axis=1)
        found["position_rms_m"] = rms(distance)
        found["position_max_m"] = float(np.nanmax(distance, initial=0.0))
        found["yaw_rms_deg"] = float(np.degrees(rms(yaw[rows])))
        position, velocity, _ = flight.estimation_error
        if len(position):
            found["estimate_position_rms_m"] = rms(np.linalg.norm(position[rows], axis=1))
            found["estimate_velocity_rms_m_s"] = rms(np.linalg.norm(velocity[rows], axis=1))
    if log.has("actuators") and spans:
        series = log.topics["actuators"]
        rows = within(series.time, spans)
        motors = series.rows(MOTOR_REFERENCES)[rows]
        scaling = series.rows(("scaling",))[rows]
        if len(motors):
            found["motor_mean_counts"] = float(np.nanmean(motors))
            found["saturated_share"] = float(np.mean(scaling < 1.0))
    held = [(max(a, c), min(b, d)) for a, b in flagged(log.topics, AT_BOUND) for c, d in spans]
    if held:
        found["at_bound_s"] = sum(max(0.0, end - start) for start, end in held)
    if spans:
        found["airborne_s"] = sum(end - start for start, end in airborne(log))
    return {name: value for name, value in found.items() if np.isfinite(value)}


def _made(log: RunLog, out: Judgement) -> Experiment | None:
    """Return the experiment with the options in the log, None for one that is not here."""
    if out.experiment not in experiments():
        return None
    try:
        experiment = find(out.experiment, log.vehicle or "quad1")
    except UsageError as error:
        out.source = out.source or str(error)
        return None
    if experiment.parameters is not None:
        for name, value in out.options.items():
            if name in type(experiment.parameters).model_fields:
                setattr(experiment.parameters, name, value)
    return experiment


def _stored(log: RunLog, out: Judgement) -> None:
    try:
        stored = read_result(log.path)
        out.metrics, out.limits = _numbers(stored.get("metrics")), _numbers(stored.get("limits"))
        verdict = str(stored.get("verdict", ""))
        out.verdict = verdict if verdict in VERDICTS else ""
        out.decision = str(stored.get("decision", ""))
        if isinstance(stored.get("proposal"), Mapping):
            out.proposal = parse_record(json.dumps(stored["proposal"]))
        options = stored.get("options")
        out.options = dict(options) if isinstance(options, Mapping) else out.options
        reason = str(stored.get("reason", "")) if out.verdict == NOT_JUDGED else ""
        out.source = reason or "judged after the flight (result.json)"
    except QuadlabError as error:
        out.source = str(error)


def _evaluated(log: RunLog, out: Judgement, experiment: Experiment) -> None:
    try:
        result = evaluated(experiment, log.path)
    except QuadlabError as error:
        limits: dict[str, float] = LIMITS.get(out.kind, {})
        if out.windows and limits and limits.keys() <= out.flight.keys():
            result = judged({name: out.flight[name] for name in limits}, limits)
            start, end = out.windows[0]
            _taken(out, result, f"judged by this report from {start:.1f} to {end:.1f} s of the log")
        else:
            out.source = str(error)
        return
    _taken(out, result, "judged by this report from the log")


def _taken(out: Judgement, result: Result, source: str) -> None:
    out.verdict, out.metrics, out.limits = result.verdict, result.metrics, result.limits
    out.source = result.reason if result.verdict == NOT_JUDGED else source


def _proposed(log: RunLog, out: Judgement, experiment: object) -> None:
    """Set the calibration that the run proposed: as published, or else computed again."""
    text = log.experiment_text("proposal")
    out.decision = out.decision or log.experiment_text("decision")
    try:
        if out.proposal is None and text:
            out.proposal = parse_record(text)
        elif (
            out.proposal is None
            and isinstance(experiment, Calibrating)
            and out.experiment not in FLOWN
        ):
            out.proposal = experiment.proposal(log.path)
    except QuadlabError as error:
        out.source = f"{out.source}; no calibration: {error}"


def _numbers(values: object) -> dict[str, float]:
    if not isinstance(values, Mapping):
        return {}
    return {
        str(name): float(value)
        for name, value in values.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
