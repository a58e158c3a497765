"""A trajectory from a CSV file: t, x, y, z, yaw, and optionally all their derivatives.

With the five columns alone, the path is that of least snap through the rows (a spline of seventh
order: continuous to snap), at rest at both ends. With the derivatives, the rows are joined by
pieces of ninth order that match them all.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from control.trajectories.minimum_snap import minimum_snap
from control.trajectories.polynomial import Polynomial
from control.trajectories.tabulated import check_rest, join
from quadrotor.errors import RefusedError, StorageError

Array = npt.NDArray[np.float64]

COLUMNS = ("t", "x", "y", "z", "yaw")
"""Columns in s, m, m, m, rad; world axes. Yaw may be wrapped: it turns the short way."""

DERIVATIVES = (
    *("vx", "vy", "vz"),  # m/s
    *("ax", "ay", "az"),  # m/s^2
    *("jx", "jy", "jz"),  # m/s^3
    *("sx", "sy", "sz"),  # m/s^4
    *("yaw_rate", "yaw_acceleration"),  # rad/s, rad/s^2
)
"""Optional columns, all or none."""

ROWS_MAX = 20_000
SPEED_AT_ENDS = 0.3
"""Largest speed, in m/s, between the first two rows or the last two that still counts as rest."""


def load_csv(path: Path) -> Polynomial:
    """Load the trajectory in the file `path`.

    Raises RefusedError that names line and column, StorageError for a file that cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise StorageError(f"{path} cannot be read as text: {error}") from None
    table = _table(path, text)
    times = table["t"] - table["t"][0]
    points = np.stack([table["x"], table["y"], table["z"], np.unwrap(table["yaw"])], axis=1)
    if "vx" in table:
        motion = np.zeros((len(times), 4, 5))
        motion[:, :, 0] = points
        for order, letter in enumerate("vajs", start=1):
            for axis, name in enumerate("xyz"):
                motion[:, axis, order] = table[letter + name]
        motion[:, 3, 1], motion[:, 3, 2] = table["yaw_rate"], table["yaw_acceleration"]
        check_rest(path.name, times, motion)
        return join(times, motion)
    steps = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1) / np.diff(times)
    for where, speed in (("first", steps[0]), ("last", steps[-1])):
        if speed > SPEED_AT_ENDS:
            raise RefusedError(
                f"{path.name}: {speed:.2f} m/s between the {where} two rows; a trajectory starts "
                f"and ends at rest (below {SPEED_AT_ENDS:g} m/s): add rows that speed up and "
                "slow down"
            )
    return minimum_snap(points, times)


def _table(path: Path, text: str) -> dict[str, Array]:
    """Return column name -> numbers; check everything that can be wrong with a row."""
    names: list[str] | None = None
    rows: list[list[float]] = []
    for number, cells in enumerate(csv.reader(text.splitlines()), start=1):
        line = [cell.strip() for cell in cells]
        if not any(line) or line[0].startswith("#"):
            continue
        where = f"{path.name}, line {number}"
        if names is None:
            names = _header(where, line)
            continue
        if len(line) != len(names):
            raise RefusedError(f"{where}: {len(line)} values for {len(names)} columns")
        row = [_number(where, name, cell) for name, cell in zip(names, line, strict=True)]
        t = names.index("t")
        if rows and row[t] <= rows[-1][t]:
            raise RefusedError(
                f"{where}, column t: {row[t]:g} s comes after {rows[-1][t]:g} s; times must rise"
            )
        if len(rows) == ROWS_MAX:
            raise RefusedError(f"{where}: more than {ROWS_MAX} rows; give fewer, they are joined")
        rows.append(row)
    if names is None or len(rows) < 2:
        raise RefusedError(
            f"{path.name}: {len(rows)} rows of numbers; give a header such as "
            f"{','.join(COLUMNS)} and two rows or more"
        )
    columns = np.array(rows).T
    return {name: np.ascontiguousarray(column) for name, column in zip(names, columns, strict=True)}


def _header(where: str, names: list[str]) -> list[str]:
    known = (*COLUMNS, *DERIVATIVES)
    for k, name in enumerate(names, start=1):
        if name not in known:
            raise RefusedError(
                f"{where}, column {k}: {name!r} is not a column's name; there are "
                f"{', '.join(known)}"
            )
        if names.count(name) > 1:
            raise RefusedError(f"{where}, column {k}: {name} is there twice")
    wanted = known if any(name in DERIVATIVES for name in names) else COLUMNS
    missing = [name for name in wanted if name not in names]
    if missing:
        raise RefusedError(
            f"{where}: column {', '.join(missing)} is missing; give {', '.join(COLUMNS)}, and "
            "of the derivatives all or none"
        )
    return names


def _number(where: str, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RefusedError(f"{where}, column {name}: {cell!r} is not a finite number")
    return value
