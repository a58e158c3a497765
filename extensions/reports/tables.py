"""The tables of results: figures with limits and references, calibrations."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime

from console.reports.content import Block, Heading, Table, Text
from console.reports.judgement import Judgement
from console.reports.run_log import RunLog
from extensions.reports.references import FIGURES
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import QuadlabError
from quadrotor.parameter_description import ParameterValue

SMALL_MASS = 0.1
"""Mass in kg below which masses are shown in grams."""
NOT_RECORDED = "not recorded"
UNITS = (
    ("_n_m", "mN m", 1e3),
    ("_m_s2", "m/s²", 1.0),
    ("_rad_s", "rad/s", 1.0),
    ("_m_s", "mm/s", 1e3),
    ("_m", "mm", 1e3),
    ("_deg_s", "°/s", 1.0),
    ("_deg", "°", 1.0),
    ("_kg_m2", "kg m²", 1.0),
    ("_kg", "kg", 1.0),
    ("_share", "%", 1e2),
    ("_s", "s", 1.0),
    ("_counts", "counts", 1.0),
    ("_count", "counts", 1.0),
    ("_percent", "%", 1.0),
    ("_N", "N", 1.0),
)
"""Suffixes of figure names, with the displayed unit and its factor."""
IN_METRES = frozenset({"torque_ratio_m", "sag_m"})


def figure(name: str, value: float) -> tuple[str, str]:
    """Return a figure as text: its name, and its value with the unit."""
    for ending, unit, factor in UNITS:
        if name.endswith(ending):
            what = name.removesuffix(ending).replace("_", " ")
            if name in IN_METRES:
                return what, f"{number(value)} m"
            if unit == "kg" and abs(value) < SMALL_MASS:
                return what, f"{number(1e3 * value)} g"
            gap = "" if unit.startswith("°") else " "
            return what, f"{number(value * factor)}{gap}{unit}"
    return name.replace("_", " "), number(value)


def number(value: float) -> str:
    """Return the number with four digits, integers in full."""
    if not math.isfinite(value):
        return "–"
    if value == int(value) and abs(value) < 1e7:
        return str(int(value))
    return f"{value:.4g}"


def shown(value: object) -> str:
    """Return a parameter's value as text."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


# ---------------------------------------------------------------------- figures
def metrics_blocks(judged: Judgement) -> list[Block]:
    """Return the figures with their limits and, where available, reference figures."""
    rows = []
    for name, value in judged.metrics.items():
        limit = judged.limits.get(name)
        what, shown = figure(name, value)
        if limit is None or not math.isfinite(limit):
            rows.append((what, shown, "", ""))
        else:
            kept = "kept" if value <= limit else "EXCEEDED"
            rows.append((what, shown, figure(name, limit)[1], kept))
    blocks: list[Block] = []
    head = ("figure", "this run", "at most", "limit")
    if rows:
        blocks.append(Table("Figures and limits", head, rows, "46l 20r 20r 14l"))
    others = {k: v for k, v in judged.flight.items() if k not in judged.metrics}
    if others:
        title = "Figures of the flight, of this report" if rows else "Figures of the flight"
        found = [figure(name, value) for name, value in others.items()]
        blocks.append(Table(title, ("figure", "this run"), found, "46l 54r"))
    compared = FIGURES.get(judged.experiment, ())
    if compared:
        proposed = judged.proposal.values if judged.proposal is not None else {}
        numbers = {k: float(v) for k, v in proposed.items() if isinstance(v, int | float)}
        own = {**numbers, **judged.flight, **judged.metrics}
        if "torque_ratio_m" in own:
            own.setdefault("model.torque_ratio", own["torque_ratio_m"])
        options = {"laps": judged.kind[1], **judged.options}
        lines = [
            (
                one.what,
                one.value,
                figure(one.metric, own[one.metric])[1]
                if one.metric in own and one.fits(options)
                else "",
                one.source,
            )
            for one in compared
        ]
        head = ("reference figure", "value", "this run", "whose")
        blocks.append(Table("Comparison with reference figures", head, lines, "36l 23r 19r 22l"))
    return blocks


# ---------------------------------------------------------------------- calibrations
def proposal_blocks(judged: Judgement, present: Mapping[str, ParameterValue]) -> list[Block]:
    """Return the calibration that the run proposed, next to the values used in the run."""
    record = judged.proposal
    if record is None:
        return []
    if not record.previous:
        before = {name: present[name] for name in record.values if name in present}
        record = record.model_copy(update={"previous": before})
    decision = {"accepted": "It was accepted.", "rejected": "It was rejected."}.get(
        judged.decision, "It was not accepted or rejected yet when this report was written."
    )
    blocks: list[Block] = [Heading(f"Calibration found: {record.name}"), Text(decision)]
    blocks += [Text(warning, warning=True) for warning in record.warnings]
    return blocks + _record_tables(record, folded=False)


def calibration_blocks(log: RunLog) -> list[Block]:
    """Return the calibrations in force at the start of the log."""
    blocks: list[Block] = [Heading("Calibrations in force")]
    content = log.json_attachment("calibrations.json")
    if not isinstance(content, Mapping):
        return [*blocks, Text(f"{NOT_RECORDED.capitalize()} in this log.")]
    if problem := str(content.get("problem", "")):
        blocks.append(Text(problem, warning=True))
    in_force = content.get("in_force")
    if not isinstance(in_force, Mapping):
        return blocks if problem else [*blocks, Text(f"{NOT_RECORDED.capitalize()} in this log.")]
    rows, details = [], list[Block]()
    for name, raw in in_force.items():
        try:
            record = parse_record(json.dumps(raw))
        except QuadlabError as error:
            rows.append((str(name), "", "", "", str(error)))
            continue
        quality = ", ".join(
            f"{one.name} {number(one.value)} {one.unit}".strip() for one in record.quality[:3]
        )
        rows.append((record.name, day(record.stamp_ns), record.requester, record.run_id, quality))
        details += _record_tables(record, folded=True)
    if not rows:
        return [*blocks, Text("None: the vehicle used the values of its parameters.")]
    head = ("calibration", "date", "by", "from run", "quality")
    table = Table("", head, rows, "14l 18l 12l 22l 34l")
    return [*blocks, table, *details]


def _record_tables(record: CalibrationRecord, *, folded: bool) -> list[Block]:
    blocks: list[Block] = []
    if record.values:
        title = f"{record.name}: values" if folded else "Values"
        rows = [
            (name, shown(value), shown(record.previous[name]) if name in record.previous else "")
            for name, value in record.values.items()
        ]
        blocks.append(Table(title, ("parameter", "value", "before"), rows, "50l 25r 25r", folded))
    judged = [*record.quality, *record.figures]
    if judged:
        rows_ = [
            (
                one.name,
                f"{number(one.value)} {one.unit}".strip(),
                "" if one.limit is None else f"{number(one.limit)} {one.unit}".strip(),
                "" if one.limit is None else "kept" if one.good else "EXCEEDED",
            )
            for one in judged
        ]
        title = f"{record.name}: quality" if folded else "Quality"
        head = ("quality", "value", "at most", "limit")
        blocks.append(Table(title, head, rows_, "46l 20r 20r 14l", folded))
    if record.residuals:
        each = [(name, number(value)) for name, value in record.residuals]
        title = f"{record.name}: residuals" if folded else "Residuals"
        is_long = folded or len(each) > 12
        blocks.append(Table(title, ("of", "residual"), each, "70l 30r", is_long))
    if record.conditions and not folded:
        found = list(record.conditions.items())
        blocks.append(Table("Conditions", ("condition", "value"), found, "30l 70l"))
    return blocks


def day(stamp_ns: int) -> str:
    """Return date and time in UTC; empty for a clock that began at 0."""
    if stamp_ns < 10**17:
        return ""
    return datetime.fromtimestamp(stamp_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M UTC")
