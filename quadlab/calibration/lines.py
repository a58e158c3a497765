"""Calibrations as lines for a terminal and as JSON: those in force, and a proposal next to them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any

from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore

FIGURES = 3
"""Number of key figures in a line of the list."""
NONE = "–"


def listed(
    calibrations: Mapping[str, str], force: Mapping[str, CalibrationRecord]
) -> Iterable[str]:
    """Yield a line for each calibration.

    Args:
        calibrations: name of each experiment and of the record that it proposes.
        force: records in force, by their name.
    """
    known = {record: name for name, record in calibrations.items()}
    names = {**calibrations, **{name: name for name in force if name not in known}}
    width = max((len(name) for name in names), default=0)
    for name, of_record in names.items():
        record = force.get(of_record)
        if record is None:
            yield f"{name:{width}}  never calibrated"
            continue
        figures = [*record.quality, *record.figures][:FIGURES]
        shown = ", ".join(f"{one.name} {quantity(one.value, one.unit)}" for one in figures)
        yield f"{name:{width}}  {when(record)}  by {who(record)}  {shown}".rstrip()


def when(record: CalibrationRecord) -> str:
    if not record.stamp_ns:
        return "at an unknown time"
    return f"{datetime.fromtimestamp(record.stamp_ns * 1e-9):%Y-%m-%d %H:%M}"


def who(record: CalibrationRecord) -> str:
    return {"": "nobody known", "start": "the vehicle at its start"}.get(
        record.requester, record.requester
    )


def comparison_rows(
    record: CalibrationRecord, before: CalibrationRecord | None, present: Mapping[str, Any]
) -> list[tuple[str, str, str, str]]:
    """Return rows of name, present value, proposed value and judgement.

    Args:
        before: the record in force.
        present: the vehicle's values by name.
    """
    rows = []
    for name, value in record.values.items():
        rows.append((name, _value(present.get(name)), _value(value), ""))
    for new, old in (
        (record.figures, before.figures if before else ()),
        (record.quality, before.quality if before else ()),
    ):
        earlier = {one.name: one for one in old}
        for one in new:
            was = earlier.get(one.name)
            then = quantity(was.value, was.unit) if was else NONE
            rows.append((one.name, then, quantity(one.value, one.unit), _judged(one)))
    return rows


def notes(record: CalibrationRecord) -> Iterable[str]:
    """Yield additional notes on the figures."""
    for text in record.warnings:
        yield f"warning: {text}"
    worst = max(record.residuals, key=lambda one: abs(one[1]), default=None)
    if worst is not None:
        yield f"largest residual: {worst[0]}: {worst[1]:.4g}"
    if record.conditions:
        yield "under: " + ", ".join(f"{name} {text}" for name, text in record.conditions.items())


def table(rows: Sequence[tuple[str, ...]]) -> Iterable[str]:
    """Yield the rows in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)).rstrip()


def quantity(value: float, unit: str) -> str:
    if not math.isfinite(value):
        return NONE
    return f"{value:.4g} {unit}".rstrip()


def _value(value: Any) -> str:
    if value is None:
        return NONE
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _judged(one: Quality) -> str:
    if one.limit is None:
        return ""
    bound = quantity(one.limit, one.unit)
    return f"good (at most {bound})" if one.good else f"BEYOND ITS LIMIT of {bound}"


HOW = "nothing was changed; on a vehicle, accept it on the page or with: quadlab calibrate"


def proposal_lines(record: CalibrationRecord, store: ParameterStore) -> list[str]:
    """Return the proposal as short lines."""
    lines = [f"proposal {record.name}{'' if record.good else ': beyond its limits'}"]
    for name, value in record.values.items():
        unit = store.description(name).unit if name in store.names else ""
        lines.append(f"  {name:28} {_number(_present(store, name)):>12} -> {_number(value)} {unit}")
    lines += [f"  {_figure(one)}" for one in (*record.figures, *record.quality)]
    lines += [f"  warning: {warning}" for warning in record.warnings]
    return [*(line.rstrip() for line in lines), f"  {HOW}"]


def proposal_json(record: CalibrationRecord, store: ParameterStore) -> dict[str, Any]:
    """Return the record, with the values that it would replace as `present`."""
    present = {name: _present(store, name) for name in record.values}
    return record.model_dump(mode="json") | {"good": record.good, "present": present}


def _present(store: ParameterStore, name: str) -> ParameterValue | None:
    return store.get(name) if name in store.names else None


def _figure(one: Quality) -> str:
    bound = f"   (at most {one.limit:g})" if one.limit is not None else ""
    return f"{one.name:28} {one.value:12.5g} {one.unit}{bound}"


def _number(value: ParameterValue | None) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return "-" if value is None else str(value)
