"""The stored calibrations that apply at a start of the vehicle, and the values they set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import ParameterError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.parameters import check_pairs, new_parameters

GYROSCOPE = "gyroscope"
"""Name of the calibration whose drift is found again at each start."""


@dataclass
class StartValues:
    """The initial parameter values that result from the stored calibrations.

    Attributes:
        values: parameters to start with, including those given by hand.
        refused: stamps (ns) of records that do not apply.
        lines: lines for the log, each with whether it is a warning.
    """

    values: dict[str, ParameterValue] = field(default_factory=dict)
    refused: list[int] = field(default_factory=list)
    lines: list[tuple[bool, str]] = field(default_factory=list)


def start_values(
    newest: Iterable[CalibrationRecord],
    given: Mapping[str, ParameterValue],
    of_board: Mapping[str, ParameterValue] | None = None,
) -> StartValues:
    """Combine calibrations with the values given on the command line (`--set`), which win.

    A record is applied completely or not at all. A record whose values the parameters no longer
    allow is rejected; the others are applied.

    Args:
        newest: the newest record of each name, oldest first.
        of_board: the board's own values, with which the others must be allowed together.
    """
    found, of_board = StartValues(), of_board or {}
    try:
        ParameterStore(new_parameters()).preset({**of_board, **given})
    except ParameterError:  # reported where the vehicle starts with them
        found.values.update(given)
        return found
    taken: list[str] = []
    for record in newest:
        if record.name == GYROSCOPE:
            continue
        try:
            _check(record.values, {**of_board, **found.values}, given)
        except ParameterError as error:
            found.refused.append(record.stamp_ns)
            found.lines.append(
                (True, f"calibration {described(record)} is not in force: {error}; calibrate again")
            )
            continue
        found.values.update(record.values)
        if record.values and record.values.keys() <= given.keys():
            found.refused.append(record.stamp_ns)
            why = f"--set {_text(record, given)}"
            found.lines.append((False, f"calibration {described(record)} is not in force: {why}"))
            continue
        but = f" but for --set {_text(record, given)}" if record.values.keys() & given else ""
        taken.append(described(record) + but)
    if taken:
        found.lines.append((False, f"calibrations in force: {', '.join(taken)}"))
    found.values.update(given)
    return found


def _text(record: CalibrationRecord, given: Mapping[str, ParameterValue]) -> str:
    return ", ".join(f"{name}={given[name]}" for name in record.values if name in given)


def described(record: CalibrationRecord) -> str:
    """Return name, date and requester of a record in one line."""
    instant = datetime.fromtimestamp(record.stamp_ns / 1e9, UTC)
    who = f" by {record.requester}" if record.requester else ""
    return f"{record.name} of {instant:%Y-%m-%d %H:%M} UTC{who}"


def _check(
    values: Mapping[str, ParameterValue],
    before: Mapping[str, ParameterValue],
    given: Mapping[str, ParameterValue],
) -> None:
    """Raise ParameterError when values are not allowed, alone or together with the others."""
    store = ParameterStore(new_parameters())
    for name, value in values.items():
        store.check(name, value)
    store.preset({**before, **values, **given})
    check_pairs(store.values())
