"""An experiment's proposal to the vehicle next to the present values, as text and as JSON."""

from __future__ import annotations

from typing import Any

from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.parameters import ParameterStore, ParameterValue

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
