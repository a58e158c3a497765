"""Numbers and dates in the cells of a text table, as people and their programs write them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal

MISSING = frozenset(
    (
        *("", "nan", "na", "n/a", "n.a.", "<na>", "#n/a", "#na", "null", "(null)", "nil", "none"),
        *("-", "--", "?", "*", "#div/0!", "#num!", "#value!", "#ref!"),
    )
)
"""Words for a number that is missing, in lower case."""
NO_NUMBER = re.compile(r"[-+]?(?:1\.#(?:ind|inf|qnan|snan)\d*|nan\(\w*\))", re.IGNORECASE)
"""NaN and infinity as C's libraries print them."""
GROUPED = re.compile(r"[-+]?\d{1,3}(?:[ '\u2019\u00a0\u202f]\d{3})+(?:[.,]\d*)?")
"""A number with separators of thousands other than points and commas."""
THOUSANDS = "has a separator of thousands: write numbers without"
DATE = re.compile(
    r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d{1,9})\d*)? ?(Z|UTC|[-+]\d\d:?\d\d)?"
)
"""ISO 8601, also with a space and a decimal comma."""
OTHER_DATE = re.compile(r"(?:\d{4}([/.-])\d\d?\1\d\d?|\d\d?([/.-])\d\d?\2\d{2}(?:\d\d)?)(?!\d).*")
"""A date of another form, of which day and month may be either."""
NO_DATE = "is a date of another form than is read: write it like 2026-11-29T12:00:00.5Z"
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Cells:
    """The numbers in the cells of one table, in which all have the same decimal mark.

    Attributes:
        dates: whether the last cell was a date, whose number is in s since 1970.
        zoneless: whether there were dates without a zone, which are taken as UTC.
    """

    def __init__(self) -> None:
        self.dates = self.zoneless = False
        self._has_points = self._has_commas = False

    def plain(self, texts: Sequence[str]) -> list[float] | None:
        """Return the numbers of a row at once, None where `number` is needed for one of them."""
        whole = "".join(texts)
        if self._has_commas or "_" in whole:
            return None
        try:
            found = list(map(float, texts))
        except ValueError:
            return None
        self._has_points |= "." in whole
        return found

    def number(self, text: str) -> float:
        """Return the number in a cell, NaN where it is missing.

        Raises ValueError, with words for what is wrong with a number.
        """
        self.dates = False
        try:
            found = float(text)
        except ValueError:
            if is_missing(text):
                return float("nan")
            if DATE.fullmatch(text):
                self.dates = True
                self.zoneless |= _zone(text) is None
                return float(exact(text))
            if OTHER_DATE.fullmatch(text):
                raise ValueError(NO_DATE) from None
            if text.count(",") != 1 or "." in text:
                raise ValueError(THOUSANDS if is_grouped(text) else "is no number") from None
            try:
                found = float(_with_point(text))
            except ValueError:
                raise ValueError("is no number") from None
            self._has_commas = True
        else:
            if "_" in text:
                raise ValueError("is no number")
            self._has_points |= "." in text
        if self._has_commas and self._has_points:
            raise ValueError(
                "has another decimal mark than numbers before it, or a separator of thousands: "
                "write all numbers alike"
            )
        return found


def exact(text: str) -> Decimal:
    """Return the number or date (s since 1970) that a cell has, with all of its digits.

    Raises ValueError where it has none.
    """
    if date := DATE.fullmatch(text):
        zone = (_zone(text) or "Z").replace("UTC", "Z")
        at = datetime.fromisoformat(f"{date[1]}T{date[2]}{zone}")
        seconds = (at - EPOCH) // timedelta(seconds=1)
        return seconds + Decimal(f"0.{date[3] or 0}")
    return Decimal(_with_point(text))


def remainder(text: str) -> float:
    """Return by how much the number of a cell is more than its float64."""
    if text.isdecimal():
        return float(int(text) - int(float(text)))
    number = Decimal(0) if is_missing(text) else exact(text)
    return float(number - Decimal(float(number))) if number.is_finite() else 0.0


def is_number(text: str) -> bool:
    """Return whether a cell has a number or a date, also one that is refused with its reason."""
    if is_missing(text):
        return False
    try:
        Cells().number(text)
    except ValueError as error:
        return str(error) == THOUSANDS
    return True


def is_missing(text: str) -> bool:
    """Return whether a cell is empty, or has a word for a number that is missing."""
    return text.lower() in MISSING or NO_NUMBER.fullmatch(text) is not None


def is_grouped(text: str) -> bool:
    """Return whether a cell has a number with separators of thousands."""
    if GROUPED.fullmatch(text):
        return True
    return re.fullmatch(r"[-+]?\d{1,3}(?:[.,]\d{3})+(?:[.,]\d*)?", text) is not None


def _with_point(text: str) -> str:
    return text.replace(",", ".")


def _zone(text: str) -> str | None:
    found = DATE.fullmatch(text)
    return found[4] if found else None
