"""Tables of numbers as text: CSV and similar, read by the standard library's csv module."""

from __future__ import annotations

import codecs
import csv
import itertools
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np

from extensions.importers.readers.tables import FileTables, check_size
from extensions.importers.units import unit_of
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

HEAD_LINES = 2000
"""Number of lines of a text file in which its first row of numbers is searched."""
LONGEST_LINE = 1 << 20
"""Longest line in characters; a file with a longer one is not a table."""
DELIMITERS = (";", "\t", ",", " ")
"""In the order of trial: a comma may also precede decimals, and a space may follow a comma."""
TAIL = 4096
"""Number of bytes at the end of a file in which its last line is searched."""
MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
"""Words for a number that is missing, in lower case."""
UNIT = re.compile(r"(?P<name>.*\S)(?P<space>\s*)[\[(](?P<unit>[^\])]*)[\])]")
"""A column's name with its unit behind it, in brackets."""


class Head(NamedTuple):
    """The lines before the first row of numbers, and how its values are separated."""

    delimiter: str
    lines: int
    """Lines before the first row of numbers."""
    width: int
    """Values in a row."""
    rows: list[list[str]]
    """The cells of up to two lines before it."""


class TextTable(FileTables):
    """CSV, also with ; or spaces; columns by their header, else by their number from 0."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        self._encoding = _encoding(path)
        with self._open() as file:
            self._head = _head(path, file)
        self._names, self.units = _names(self._head)
        self._rows = self._rows_of_torn()

    def columns(self, table: str) -> list[str]:
        return self._names

    def read(self, table: str, names: list[str]) -> Array:
        wanted = [self._names.index(one) for one in names]
        values = array("d")
        with self._open() as file:
            for number, row in enumerate(self._complete_rows(file), 1):
                check_size(self.path, number, len(wanted))
                values.extend([self._value(row, column, number) for column in wanted])
        return np.frombuffer(values, dtype=np.float64).reshape(-1, len(wanted))

    def _open(self) -> TextIO:
        return self.path.open(encoding=self._encoding, errors="replace", newline="")

    def _all_rows(self, file: TextIO) -> Iterator[list[str]]:
        for _ in range(self._head.lines):
            file.readline()
        yield from _readable(self.path, _reader(file, self._head.delimiter))

    def _complete_rows(self, file: TextIO) -> Iterator[list[str]]:
        """Yield the rows of numbers. Raises LogFormatError."""
        rows = filter(_has_values, self._all_rows(file))
        for number, row in enumerate(itertools.islice(rows, self._rows), 1):
            width = len(row)
            if width < self._head.width or any(row[self._head.width :]):
                raise LogFormatError(
                    f"{self.path.name}: row {number} has {width} values, the first one has "
                    f"{self._head.width}: write it again, or cut the file before it"
                )
            yield row

    def _rows_of_torn(self) -> int | None:
        """Return the number of complete rows if the last one is torn, else None."""
        with self.path.open("rb") as file:
            file.seek(-min(TAIL, self.path.stat().st_size), 2)
            text = file.read().decode(self._encoding.removesuffix("-sig"), errors="replace")
        lines = [one for one in text.splitlines() if one.strip() and not one.startswith("#")]
        last = len(_split(lines[-1], self._head.delimiter))
        if last >= self._head.width:
            return None
        self.torn = f"its last line has {last} of {self._head.width} values"
        with self._open() as file:
            return sum(map(_has_values, self._all_rows(file))) - 1

    def _value(self, row: Sequence[str], column: int, number: int) -> float:
        """Return a value of a row. Raises LogFormatError."""
        text = row[column].strip()
        try:
            return _float(text, self._head.delimiter)
        except ValueError as error:
            raise LogFormatError(
                f"{self.path.name}: row {number}, column {self._names[column]!r}: {text[:40]!r} "
                f"{str(error) or 'is no number'}"
            ) from None


def _encoding(path: Path) -> str:
    """Return the encoding: by the byte order mark, else UTF-8 or, where it is none, Latin-1."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with path.open("rb") as file:
        start = file.read(LONGEST_LINE)
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        decoder.decode(start)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _reader(lines: Iterable[str], delimiter: str) -> Iterator[list[str]]:
    if delimiter == " ":  # several of them are one
        lines = map(str.strip, lines)
    return csv.reader(lines, delimiter=delimiter, skipinitialspace=True)


def _readable(path: Path, reader: Iterable[list[str]]) -> Iterator[list[str]]:
    """Yield rows; raise LogFormatError where there is none, as within a quotation without end."""
    try:
        yield from reader
    except csv.Error as error:
        raise LogFormatError(f"{path.name} is no table: {error!s:.120}") from None


def _has_values(row: Sequence[str]) -> bool:
    return any(row) and not row[0].startswith("#")


def _split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, none of what is no line of a table."""
    try:
        cells = next(_reader([line], delimiter), [])
    except csv.Error:
        return []
    return [one.strip(' "\r\n') for one in cells]


def _head(path: Path, file: TextIO) -> Head:
    """Return the head of a table. Raises LogFormatError."""
    before: list[str] = []
    for number, line in enumerate(iter(lambda: file.readline(LONGEST_LINE), "")):
        if number > HEAD_LINES or len(line) == LONGEST_LINE:
            break
        for only in (True, False):
            for delimiter in DELIMITERS:
                row = _split(line, delimiter)
                if _is_of_numbers(row, delimiter, only=only):
                    words = [_words(one, delimiter) for one in before]
                    if not row[-1] and any(len(one) == len(row) - 1 for one in words):
                        row.pop()  # behind a delimiter at the end of each row
                    return Head(delimiter, number, len(row), words)
        if line.strip():
            before = [*before[-1:], line]
    raise LogFormatError(f"{path.name} has no rows of numbers in its first {HEAD_LINES} lines")


def _words(line: str, delimiter: str) -> list[str]:
    """Return the names in a line. A comment sign may precede them, also as a separate word."""
    return _split(line.lstrip("# \ufeff") if line.startswith(("#", "\ufeff")) else line, delimiter)


def _is_of_numbers(row: Sequence[str], delimiter: str, *, only: bool) -> bool:
    """Return whether a row has numbers: none but numbers and missing ones, or most of them."""
    if len(row) < 2 or not _is_number(row[0], delimiter):
        return False
    numbers = sum(_is_number(one, delimiter) for one in row)
    if only:
        return numbers + sum(one.lower() in MISSING for one in row) == len(row)
    return numbers > len(row) / 2


def _is_number(text: str, delimiter: str) -> bool:
    try:
        _float(text, delimiter)
    except ValueError:
        return False
    return text.lower() not in MISSING


def _float(text: str, delimiter: str) -> float:
    """Return a number as people write it; a comma before decimals where it separates no values.

    Raises ValueError.
    """
    if "," in text and delimiter != ",":
        if "." in text or text.count(",") > 1:
            raise ValueError("has a separator of thousands: write numbers without")
        text = text.replace(",", ".")
    if text.lower() in MISSING:
        return float("nan")
    if "_" in text:
        raise ValueError
    try:
        return float(text)
    except ValueError:
        raise ValueError from None


def _is_unit(text: str) -> bool:
    return text.lower() in MISSING or unit_of(text.strip("[]()")) is not None


def _names(head: Head) -> tuple[list[str], dict[str, str]]:
    """Return the names of the columns, and their units as far as the header tells them."""
    rows = [row[1:] if len(row) == head.width + 1 and not row[0] else row for row in head.rows]
    fitting = [row for row in rows if len(row) == head.width]
    units = [""] * head.width
    if len(fitting) == 2 and all(map(_is_unit, fitting[-1])):
        units = [one.strip("[]()") for one in fitting.pop()]
    if not fitting:
        return [str(k) for k in range(head.width)], {}
    names = list(fitting[-1])
    for k, text in enumerate(fitting[-1]):
        found = UNIT.fullmatch(text)
        if found and (found["space"] or unit_of(found["unit"])):
            names[k], units[k] = found["name"], units[k] or found["unit"]
    return names, {name: unit for name, unit in zip(names, units, strict=True) if unit}
