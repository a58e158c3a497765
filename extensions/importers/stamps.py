"""Judgement of a column of times: its unit, dates that computers have had, gaps and counters.

A stamp that cannot be right is refused with its row, and with the unit that would fit; a counter
that began anew at its largest number is continued, with a note.
"""

from __future__ import annotations

import itertools
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from extensions.importers.flights import LONGEST_GAP
from extensions.importers.rows import Mask, largest_step, release, steps_where, usual_step
from extensions.importers.units import TIME_UNITS
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

COUNTER_BITS = (16, 24, 31, 32)
"""Sizes of the counters of time that embedded computers have."""
AT_WRAP = 50.0
"""Largest step over the end of a counter, in median steps: a few rows may be missing there."""
LAST_DATE = 2.0**32
"""s since 1970: February 2106. Later stamps are in another unit."""
EARLIEST = -86400.0
"""s: stamps may begin before the time that they count from, but not by days."""
SLOWER = 4.0
"""Ratio below the likely rates at which another unit that fits is taken for the right one."""
LONGEST_STRAY = 3
"""Largest number of stray stamps in a row."""
STRAYS = 0.01
"""Largest share of stray stamps that is left out."""
IS_RIGHT = "is time the right column?"
YEAR = 365.25 * 86400.0
Rows = npt.NDArray[np.integer]


class Rates(NamedTuple):
    """Rates in Hz that a table of a kind can have: likely ones, and the largest."""

    likely: tuple[float, float]
    largest: float


RATES_OF_IMU = Rates((20.0, 10_000.0), 40_000.0)
RATES = Rates((0.5, 10_000.0), 40_000.0)


def judge(
    stamps: Array, unit: str, rows: Rows, rates: Rates, where: str, *, certain: bool = False
) -> None:
    """Refuse stamps that cannot be right.

    Args:
        stamps: (N,), finite, N > 1, in `unit`.
        rows: (N,), their rows in the file, from 1.
        where: the file and the section of the mapping.
        certain: whether the file itself tells the unit, so that no other one is thought of.

    Raises LogFormatError.
    """
    second = TIME_UNITS[unit]
    if len(back := steps_where(stamps, lambda steps: steps < 0.0)):
        k = back[0]
        raise LogFormatError(
            f"{where}: stamps go back {len(back)} times, first from {second * stamps[k]:.6f} s to "
            f"{second * stamps[k + 1]:.6f} s in row {rows[k + 1]}; was the clock set, or {IS_RIGHT}"
        )
    hint = partial(_hint, stamps, "" if certain else unit, rates)
    middle = float(stamps[len(stamps) // 2] * second)
    if not EARLIEST <= middle <= LAST_DATE:
        raise LogFormatError(
            f"{where}: the stamps are about {middle:.3g} s in the {unit} of the mapping, "
            f"{'before 1970' if middle < 0 else 'beyond any date (2106)'}: {hint() or IS_RIGHT}"
        )
    k = largest_step(stamps)
    longest = float(stamps[k + 1] - stamps[k]) * second
    if longest > LONGEST_GAP:
        why = hint()
        raise LogFormatError(
            f"{where}: row {rows[k + 1]} is {_duration(longest)} after row {rows[k]}; if one of "
            "the two has a wrong stamp, leave it out" + f"; or {why}" * bool(why)
        )
    rate = _rate(stamps) / second
    if rate > rates.largest:
        raise LogFormatError(
            f"{where}: {rate:.6g} rows a second in the {unit} of the mapping, more than any "
            f"instrument has: {hint() or IS_RIGHT}"
        )
    if rate < rates.likely[0] / SLOWER and (why := hint()):
        raise LogFormatError(
            f"{where}: {rate:.3g} rows a second in the {unit} of the mapping, too few: {why}"
        )


def continued(stamps: Array, rows: Rows, where: str) -> tuple[Array, list[str]]:
    """Return stamps without the steps back of a counter that began anew, and notes. Other steps
    back are left for the judgement of all.
    """
    back = steps_where(stamps, lambda steps: steps < 0.0)
    if not len(back) or not (median := usual_step(stamps)):
        return stamps, []
    wraps, counter = back[:0], (0, 0.0)
    for bits, scale in itertools.product(COUNTER_BITS, (1.0, *TIME_UNITS.values())):
        period = 2.0**bits * scale
        over = stamps[back + 1] - stamps[back] + period
        least = -period / 2.0 if stamps.min() < 0.0 else 0.0  # of a signed counter
        inside = least <= stamps.min() and stamps.max() < least + period
        fitting = back[(over > 0.0) & (over <= AT_WRAP * median)]
        if inside and len(fitting) > len(wraps):
            wraps, counter = fitting, (bits, period)
    if not len(wraps):
        return stamps, []
    found = stamps.copy()
    release(stamps)
    for k in wraps:
        found[k + 1 :] += counter[1]
    return found, [
        f"{where}: the stamps are a counter of {counter[0]} bits, which begins anew in row "
        f"{rows[wraps[0] + 1]}: continued there"
    ]


def without_strays(stamps: Array, rows: Rows, where: str) -> tuple[Mask, list[str]]:
    """Return which stamps continue the series, (N,), and a note about the others.

    A stray stamp is away from those around it, which go on without it. More than a few of them are
    left for the judgement of all.
    """
    kept = np.ones(len(stamps), bool)
    usual = usual_step(stamps)
    odd = steps_where(stamps, lambda steps: (steps < 0.0) | (steps > AT_WRAP * usual))
    if len(odd) > STRAYS * len(stamps) + 2:
        return kept, []
    for k in odd.tolist():
        if not kept[k]:
            continue
        for after in range(k + 2, min(k + 2 + LONGEST_STRAY, len(stamps))):
            if 0.0 < stamps[after] - stamps[k] <= AT_WRAP * usual:
                kept[k + 1 : after] = False
                break
    lost = np.flatnonzero(~kept)
    if not len(lost) or len(lost) > max(1.0, STRAYS * len(stamps)):
        return np.ones(len(stamps), bool), []
    return kept, [
        f"{where}: {len(lost)} rows whose stamps are away from those around them left out, the "
        f"first is row {rows[lost[0]]}"
    ]


def _hint(stamps: Array, unit: str, rates: Rates) -> str:
    """Return which unit fits other than `unit`; empty if none does, or `unit` is."""
    others = [one for one in TIME_UNITS if unit and one != unit]
    found = next((one for one in others if fits(stamps * TIME_UNITS[one], rates)), "")
    return found and f'write time_unit = "{found}", which fits'


def fits(seconds: Array, rates: Rates) -> bool:
    """Return whether stamps in s can be those of a flight."""
    slow, fast = rates.likely
    rate = _rate(seconds)
    return bool(
        EARLIEST <= np.median(seconds) <= LAST_DATE
        and slow <= rate <= fast
        and np.diff(seconds).max() <= LONGEST_GAP
    )


def _rate(stamps: Array) -> float:
    """Return the usual rate of rows with different stamps, in 1 / their unit; 0 where there are
    none.
    """
    usual = usual_step(stamps)
    return 1.0 / max(usual, 1e-12) if usual else 0.0


def _duration(seconds: float) -> str:
    if seconds >= YEAR:
        return f"{seconds / YEAR:.3g} years"
    return f"{seconds / 3600.0:.3g} hours"
