"""The stored calibrations that count at a start of the vehicle, and the values they set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import ParameterError
from quadrotor.parameters import ParameterStore, ParameterValue
from vehicle.parameters import check_pairs, new_parameters

GYROSCOPE = "gyroscope"
"""The one whose drift is found anew at each start."""


@dataclass
class StartValues:
    """The start values that result from the stored calibrations.

    Attributes:
        values: parameters to start with, those given by hand among them.
        refused: stamps (ns) of records that are not in force.
        lines: for people, with whether something is wrong.
    """

    values: dict[str, ParameterValue] = field(default_factory=dict)
    refused: list[int] = field(default_factory=list)
    lines: list[tuple[bool, str]] = field(default_factory=list)


def start_values(
    newest: Iterable[CalibrationRecord], given: Mapping[str, ParameterValue]
) -> StartValues:
    """Put calibrations under what was given by hand (`--set`), which wins.

    A record goes in whole or not at all: half a calibration is none. One whose values the
    parameters no longer allow is refused, the others are kept.

    Args:
        newest: one a name, oldest first.
    """
    found = StartValues()
    try:
        ParameterStore(new_parameters()).preset(given)
    except ParameterError:  # told by who starts with them
        found.values.update(given)
        return found
    taken: list[str] = []
    for record in newest:
        if record.name == GYROSCOPE:
            continue
        try:
            _check(record.values, found.values, given)
        except ParameterError as error:
            found.refused.append(record.stamp_ns)
            found.lines.append(
                (True, f"calibration {told(record)} is not in force: {error}; calibrate anew")
            )
            continue
        found.values.update(record.values)
        if record.values and record.values.keys() <= given.keys():
            found.refused.append(record.stamp_ns)
            found.lines.append(
                (False, f"calibration {told(record)} is not in force: --set {_text(record, given)}")
            )
            continue
        but = f" but for --set {_text(record, given)}" if record.values.keys() & given else ""
        taken.append(told(record) + but)
    if taken:
        found.lines.append((False, f"calibrations in force: {', '.join(taken)}"))
    found.values.update(given)
    return found


def _text(record: CalibrationRecord, given: Mapping[str, ParameterValue]) -> str:
    return ", ".join(f"{name}={given[name]}" for name in record.values if name in given)


def told(record: CalibrationRecord) -> str:
    """Return name, date and who, for one line."""
    instant = datetime.fromtimestamp(record.stamp_ns / 1e9, UTC)
    who = f" by {record.requester}" if record.requester else ""
    return f"{record.name} of {instant:%Y-%m-%d %H:%M} UTC{who}"


def _check(
    values: Mapping[str, ParameterValue],
    before: Mapping[str, ParameterValue],
    given: Mapping[str, ParameterValue],
) -> None:
    """Raise ParameterError when values may not be set, or not together with the others."""
    store = ParameterStore(new_parameters())
    for name, value in values.items():
        store.check(name, value)
    store.preset({**before, **values, **given})
    check_pairs(store.values())
