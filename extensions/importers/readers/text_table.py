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

from extensions.importers.readers.cells import Cells, is_missing, is_number, remainder
from extensions.importers.readers.plain_columns import PlainColumns
from extensions.importers.readers.tables import FileTables, check_size
from extensions.importers.units import unit_of
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

HEAD_LINES = 2000
"""Number of lines of a text file in which its first row of numbers is searched."""
LONGEST_LINE = 1 << 20
"""Longest line in characters; a file with a longer one is not a table."""
DELIMITERS = (";", "\t", ",", "|", " ")
"""In the order of trial: a comma may also precede decimals, and a space may follow a comma."""
TAIL = 4096
"""Number of bytes at the end of a file in which its last line is searched."""
COMMENTS = ("#", "%", "//")
"""Signs with which a line begins that is a remark, or names columns behind them."""
MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
"""Encodings by the byte order mark; a longer mark before one with which it begins."""
NAME_LINES = 8
"""Largest number of lines over which names in quotation marks extend."""
BRACKETS = "[](){}<>"  # around a unit
UNIT = re.compile(r"(?P<name>.*\S)(?P<space>\s*)[\[({<](?P<unit>[^\])}>]*)[\])}>]")
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

    @property
    def names(self) -> list[list[str]]:
        """Return the lines that have as many cells as a row, without lines above and below the
        table.
        """
        framed = [one for one in self.rows if len(one) == self.width + 1]
        inside = [one[:-1] if one[0] else one[1:] for one in framed if not (one[0] and one[-1])]
        return [one for one in self.rows if len(one) == self.width] or inside


class TextTable(FileTables):
    """CSV, also with ; or spaces; columns by their header, else by their number from 0."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        self._encoding = _encoding(path)
        with self._open() as file:
            self._head = _head(path, file)
        self._names, self.units = _names(self._head)
        self._first_name = next((one[0] for one in self._head.names[-1:]), "")
        self._rows = self._rows_of_torn()
        self._plain = self._plain_columns()
        self._remainders: dict[str, Array] = {}

    def columns(self, table: str) -> list[str]:
        return self._names

    def read(self, table: str, names: list[str]) -> Array:
        wanted = [(self._names.index(one), one) for one in names]
        if self._plain:
            found = self._plain.numbers([column for column, _ in wanted])
            if found is not None:
                return found
        values, cells, dates = array("d"), Cells(), set()
        with self._open() as file:
            for number, row in enumerate(self._complete_rows(file), 1):
                check_size(self.path, number, len(wanted))
                if plain := cells.plain([row[column] for column, _ in wanted]):
                    values.extend(plain)
                    continue
                for column, name in wanted:
                    text = row[column].strip()
                    try:
                        values.append(cells.number(text))
                    except ValueError as error:
                        raise LogFormatError(
                            f"{self.path.name}: row {number}, column {name!r}: {text[:40]!r} "
                            f"{error!s}"
                        ) from None
                    if cells.dates:
                        dates.add(name)
        self.units |= dict.fromkeys(dates, "s")
        if cells.zoneless:
            self.note(f"{self.path.name}: its dates have no zone: they are taken as UTC")
        return np.frombuffer(values, dtype=np.float64).reshape(-1, len(wanted))

    def remainders(self, table: str, name: str) -> Array:
        if name not in self._remainders:  # tables of several sections have one time
            self._remainders = {name: self._found_remainders(name)}
        return self._remainders[name]

    def _found_remainders(self, name: str) -> Array:
        column = self._names.index(name)
        if self._plain and (plain := self._plain.remainders(column)) is not None:
            return plain
        with self._open() as file:
            found = array(
                "d", (remainder(row[column].strip()) for row in self._complete_rows(file))
            )
        return np.frombuffer(found, dtype=np.float64)

    def _plain_columns(self) -> PlainColumns | None:
        """Return the same table for Arrow, if both begin with the same row."""
        head = self._head
        if head.delimiter == " " or self._encoding not in ("utf-8-sig", "latin-1"):
            return None
        plain = PlainColumns(self.path, head.delimiter, head.lines, head.width)
        with self._open() as file:
            first = Cells().plain(next(self._complete_rows(file), [])[: head.width])
        return plain if first and plain.first() == first else None

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
            if row[0] == self._first_name and _stripped(row) in self._head.rows:
                continue  # the header again, as of a logger that was started again
            yield row

    def _rows_of_torn(self) -> int | None:
        """Return the number of complete rows if the last one is torn, else None."""
        size = self.path.stat().st_size
        start = max(0, (size - TAIL) // 4 * 4)  # where a character of any encoding begins
        with self.path.open("rb") as file:
            mark = _mark(file.read(4))
            file.seek(start)
            text = (mark * (start > 0) + file.read()).decode(self._encoding, errors="replace")
        lines = [one for one in text.splitlines() if one.strip() and not one.startswith(COMMENTS)]
        last = len(_split(lines[-1], self._head.delimiter)) if lines else self._head.width
        if last >= self._head.width:
            return None
        self.torn = f"its last line has {last} of {self._head.width} values"
        with self._open() as file:
            return sum(map(_has_values, self._all_rows(file))) - 1


def _mark(start: bytes) -> bytes:
    """Return the byte order mark with which a file begins, if any."""
    return next((one for one in MARKS if start.startswith(one)), b"")


def _encoding(path: Path) -> str:
    """Return the encoding: by the byte order mark, else UTF-8 or, where it is none, Latin-1."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with path.open("rb") as file:
        start = file.read(LONGEST_LINE)
    if mark := _mark(start):
        return MARKS[mark]
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
    if not any(row):
        return False
    return not row[0].startswith(COMMENTS) or is_missing(row[0].strip())


def _stripped(row: Sequence[str]) -> list[str]:
    return [one.strip() for one in row]


def _split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, none of what is no line of a table."""
    try:
        return _stripped(next(_reader(line.splitlines(keepends=True), delimiter), []))
    except csv.Error:
        return []


def _head(path: Path, file: TextIO) -> Head:
    """Return the head of a table. Raises LogFormatError."""
    before: list[str] = []
    first = ""
    likely: Head | None = None  # if all rows begin with words
    for number, line in enumerate(iter(lambda: file.readline(LONGEST_LINE), "")):
        if number > HEAD_LINES or len(line) == LONGEST_LINE:
            break
        for only, delimiter in itertools.product((True, False), DELIMITERS):
            row = _split(line, delimiter)
            if not _is_of_numbers(row, only=only):
                continue
            found = Head(delimiter, number, len(row), _before(before, delimiter))
            if only or is_number(row[0]):
                if not row[-1] and any(len(one) == len(row) - 1 for one in found.rows):
                    found = found._replace(width=len(row) - 1)  # a delimiter behind each row
                return found
            likely = likely or found
        if line.strip("".join(DELIMITERS) + "\r\n"):
            first = first or f", which begin with {line.strip()[:40]!r}"
            before = [*before[1 - NAME_LINES :], line]
    if likely:
        return likely
    raise LogFormatError(
        f"{path.name} has no rows of numbers in its first {HEAD_LINES} lines{first}; times are "
        "numbers or dates like 2026-11-29T12:00:00.5Z"
    )


def _before(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    """Return the cells of the last two lines; a line break within quotation marks ends none."""
    quotes = list(itertools.accumulate(one.count('"') for one in reversed(lines)))
    joined = list(lines[-2:])
    if quotes and quotes[0] % 2:  # the last line ends what another one began
        count = next((k for k, many in enumerate(quotes, 1) if many % 2 == 0), 1)
        joined = ["".join(lines[-count:])]
    return [_words(one, delimiter) for one in joined]


def _words(line: str, delimiter: str) -> list[str]:
    """Return the names in a line. A comment sign may precede them, also as a separate word."""
    if line.startswith((*COMMENTS, "\ufeff")):
        line = line.lstrip("#%/ \ufeff")
    return _split(line, delimiter)


def _is_of_numbers(row: Sequence[str], *, only: bool) -> bool:
    """Return whether a row has numbers: none but numbers and missing ones, or most of them."""
    if len(row) < 2 or row[0].startswith(COMMENTS):
        return False
    numbers = sum(map(is_number, row))
    if only and numbers + sum(map(is_missing, row)) < len(row):
        return False
    return numbers > len(row) / 2 or (only and is_number(row[0]))


def _is_unit(text: str) -> bool:
    return is_missing(text) or unit_of(text.strip(BRACKETS)) is not None


def _repeats(row: Sequence[str]) -> bool:
    """Return whether a word is there twice, as in a row of units, also of unknown ones."""
    return len(set(filter(None, row))) < len(list(filter(None, row)))


def _names(head: Head) -> tuple[list[str], dict[str, str]]:
    """Return the names of the columns, and their units as far as the header tells them."""
    fitting = head.names
    units = [""] * head.width
    are_units = all(map(_is_unit, fitting[-1])) if fitting else False
    if len(fitting) == 2 and (are_units or _repeats(fitting[1]) > _repeats(fitting[0])):
        units = [one.strip(BRACKETS) for one in fitting.pop()]
    if not fitting:
        return [str(k) for k in range(head.width)], {}
    names = list(fitting[-1])
    for k, text in enumerate(fitting[-1]):
        found = UNIT.fullmatch(text)
        if found and (found["space"] or unit_of(found["unit"])):
            names[k], units[k] = found["name"], units[k] or found["unit"]
    return names, {name: unit for name, unit in zip(names, units, strict=True) if unit}
