"""Stick movements that are played back: scripted like a pilot's, or recorded."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from quadrotor.errors import StorageError, UsageError
from quadrotor.records import Array

RATE = 50.0
"""Rate at which sticks are sent, Hz."""
COLUMNS = ("t", "forward", "left", "up", "yaw")
SETTLING = 0.25
"""Time constant of the scripted thumbs, s."""
STRONGEST = (0.6, 0.6, 0.4, 0.5)
"""Largest scripted deflection of each axis, as a share of full stick."""
HOLD = (1.0, 2.5)
"""Shortest and longest time, in s, that the scripted pilot keeps one aim."""
BOX = (0.8, 0.8, 0.3)
"""Distance in m of the aims from the starting point; the beacons' square reaches 1 m."""
SPEEDS = (1.0, 1.0, 0.5, 1.0)
"""Full-stick speeds, m/s and rad/s, that the scripted pilot assumes: the vehicle's defaults."""
EAGERNESS = 1.2
"""Commanded speed relative to the distance to the aim, 1/s."""


def scripted(seed: int, duration: float) -> Array:
    """Return (N, 4) forward, left, up, yaw in -1..1 at RATE; the same seed gives the same.

    The sequence imitates a pilot who flies about over the beacons: random aims, each kept for a
    second or two, an occasional turn, sticks that move as thumbs do and are sometimes released. The
    pilot estimates the position from the sticks alone.
    """
    random = np.random.default_rng(seed)
    out = np.zeros((math.ceil(duration * RATE), 4))
    share, dt = -math.expm1(-1.0 / (RATE * SETTLING)), 1.0 / RATE
    place, heading, now, aim, turn = np.zeros(3), 0.0, np.zeros(4), np.zeros(3), 0.0
    hold, let_go = 0, False
    strongest, speeds = np.array(STRONGEST), np.array(SPEEDS)
    for k in range(len(out)):
        if hold == 0:
            hold = round(random.uniform(*HOLD) * RATE)
            aim = random.uniform(-1.0, 1.0, 3) * BOX
            turn, let_go = random.uniform(-1.0, 1.0), random.random() < 0.2
        hold -= 1
        x, y, z = EAGERNESS * (aim - place)
        c, s = math.cos(heading), math.sin(heading)
        wanted = np.array([c * x + s * y, c * y - s * x, z, turn]) / speeds
        now = now + share * (np.clip(0.0 if let_go else wanted, -strongest, strongest) - now)
        out[k] = now
        forward, left, up, yaw = (now * speeds).tolist()
        place += dt * np.array([c * forward - s * left, s * forward + c * left, up])
        heading += dt * yaw
    return out


def recorded(path: Path) -> Array:
    """Return (N, 4) at RATE from a CSV file with the columns t (s), forward, left, up, yaw (-1..1).

    Each row holds until the time of the next. Raises StorageError, or UsageError with line and
    column.
    """
    try:
        with path.open(newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise StorageError(f"stick file {path} cannot be read: {error}") from None
    if not rows or tuple(word.strip() for word in rows[0]) != COLUMNS:
        raise UsageError(f"{path}, line 1: a stick file begins with the line {','.join(COLUMNS)}")
    table = [_row(path, line, row) for line, row in enumerate(rows[1:], start=2) if row]
    if len(table) < 2:
        raise UsageError(f"{path}: {len(table)} rows of sticks; at least 2 are needed")
    values = np.array(table)
    late = np.flatnonzero(np.diff(values[:, 0]) <= 0.0)
    if len(late):
        raise UsageError(f"{path}, line {late[0] + 3}, column t: not later than the line before")
    t = values[0, 0] + np.arange(math.ceil((values[-1, 0] - values[0, 0]) * RATE - 1e-6)) / RATE
    out: Array = values[np.searchsorted(values[:, 0], t + 1e-9, side="right") - 1, 1:]
    return out


def _row(path: Path, line: int, row: list[str]) -> list[float]:
    if len(row) != len(COLUMNS):
        raise UsageError(f"{path}, line {line}: {len(row)} columns; {','.join(COLUMNS)} are needed")
    out = []
    for name, word in zip(COLUMNS, row, strict=True):
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or (name != "t" and abs(value) > 1.0):
            allowed = "a number" if name == "t" else "-1 to 1"
            raise UsageError(f"{path}, line {line}, column {name}: {word!r}; allowed {allowed}")
        out.append(value)
    return out
