"""A motor bench recorded elsewhere: a CSV file of reference, force and torque over time."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from quadrotor.errors import MeasurementError, StorageError
from quadrotor.records import Array

COLUMNS = ("time_s", "reference", "force_N", "torque_Nm")
SPEED = "speed"
ROWS_MIN = 500
LARGEST = 50_000_000
"""Largest file in bytes: an hour at 200 Hz."""


@dataclass(frozen=True)
class BenchRecording:
    """A recording of a motor on the bench; all arrays are (N,), ordered by time."""

    time: Array  # s
    reference: Array  # counts
    force: Array  # N
    torque: Array  # N m
    speed: Array  # any unit; NaN without a tachometer


def read_bench_file(path: Path) -> BenchRecording:
    """Read a bench recording. Raises StorageError when the file cannot be read, and
    MeasurementError with the line number when it is invalid.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise StorageError(f"{path} has more than {LARGEST // 1_000_000} MB; cut it")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise StorageError(f"{path} cannot be read: {why}") from None
    lines = csv.reader(text.splitlines())
    header = [name.strip() for name in next(lines, [])]
    _check_header(path, header)
    places = [header.index(name) for name in COLUMNS]
    places += [header.index(SPEED)] if SPEED in header else []
    rows: list[list[float]] = []
    for cells in lines:
        if not any(cell.strip() for cell in cells):
            continue
        rows.append(_numbers(path, lines.line_num, header, cells, places))
        if len(rows) > 1 and rows[-1][0] <= rows[-2][0]:
            raise MeasurementError(
                f"{path.name} line {lines.line_num}: time_s = {rows[-1][0]:g} is not after "
                f"{rows[-2][0]:g}; times must increase"
            )
    if len(rows) < ROWS_MIN:
        raise MeasurementError(
            f"{path.name} line {lines.line_num}: it ends after {len(rows)} samples, "
            f"{ROWS_MIN} are needed; record at 100 Hz or more"
        )
    table = np.array(rows).T
    speed = table[4] if SPEED in header else np.full(len(rows), np.nan)
    return BenchRecording(table[0], table[1], table[2], table[3], speed)


def _check_header(path: Path, header: list[str]) -> None:
    missing = [name for name in COLUMNS if name not in header]
    if not missing:
        return
    plain = [name for name in missing if name.split("_")[0] in header]
    if plain:
        raise MeasurementError(
            f"{path.name} line 1: the column {plain[0].split('_')[0]!r} has no unit; convert it "
            f"and call it {plain[0]}"
        )
    raise MeasurementError(
        f"{path.name} line 1: the column {', '.join(missing)} is missing; needed are "
        f"{', '.join(COLUMNS)} and, with a tachometer, {SPEED}"
    )


def _numbers(
    path: Path, line: int, header: list[str], cells: list[str], places: list[int]
) -> list[float]:
    if len(cells) != len(header):
        raise MeasurementError(
            f"{path.name} line {line}: {len(cells)} values, the header has {len(header)}"
        )
    row = []
    for place in places:
        try:
            value = float(cells[place])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise MeasurementError(
                f"{path.name} line {line}: {header[place]} = {cells[place].strip()!r} is not a "
                "number"
            )
        row.append(value)
    return row
