"""Beacons from a CSV file: a header `id,x,y,z`, one beacon on each line, positions in m.

Blank lines and lines that begin with # are skipped. The header may name its unit: `x [m]`.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NoReturn

from bearing_sim.beacon_set import ID_MAX, Beacons
from quadrotor.errors import MeasurementError, os_errors

COLUMNS = ("id", "x", "y", "z")
LARGEST = 100_000
"""Largest file in bytes; a set of MAX_BEACONS takes about 2 kB."""

_HEADER = re.compile(r"(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?")


def load_beacons(path: str | Path) -> Beacons:
    """Return the beacons of a CSV file.

    Raises StorageError when it cannot be read; MeasurementError with line and column when its
    content is wrong, and DegenerateGeometryError as `Beacons` does.
    """
    path = Path(path)
    needed = "name a CSV file with the header id,x,y,z"
    with os_errors(lambda why: f"beacons {path}: {why}; {needed}"), path.open("rb") as file:
        data = file.read(LARGEST + 1)
    return read_beacons(data, path)


def read_beacons(data: bytes, name: str | Path) -> Beacons:
    """Return the beacons from the bytes of a beacon file; `name` is used in error messages.

    Raises MeasurementError and DegenerateGeometryError as `load_beacons` does.
    """
    if len(data) > LARGEST:
        raise MeasurementError(
            f"beacons {name}: more than {LARGEST} bytes; "
            "allowed is a CSV file with the header id,x,y,z and one beacon a line"
        )
    rows = _Reader(name).rows(data)
    try:
        return Beacons([id for id, *_ in rows], [place for _, *place in rows])
    except MeasurementError as error:
        raise type(error)(f"beacons {name}: {error}") from None


class _Reader:
    """Reader of one file, with errors that name the line."""

    def __init__(self, name: str | Path) -> None:
        self._name = name

    def rows(self, data: bytes) -> list[tuple[int, float, float, float]]:
        rows: list[tuple[int, float, float, float]] = []
        line_of: dict[int, int] = {}
        headed = False
        for number, line in enumerate(self._text(data).split("\n"), start=1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            cells = self._cells(number, line)
            if not headed:
                self._header(number, cells)
                headed = True
                continue
            id = self._id(number, *cells[0])
            if id in line_of:
                self._refuse(
                    number,
                    cells[0][0],
                    f"id {id} is already on line {line_of[id]}; give each beacon its own id",
                )
            line_of[id] = number
            x, y, z = (
                self._metres(number, at, name, cell)
                for (at, cell), name in zip(cells[1:], COLUMNS[1:], strict=True)
            )
            rows.append((id, x, y, z))
        if not headed:
            self._refuse(1, 1, "the file is empty; the header id,x,y,z is needed, then the beacons")
        return rows

    def _text(self, data: bytes) -> str:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            before = data[: error.start]
            column = error.start - (before.rfind(b"\n") + 1) + 1
            self._refuse(
                before.count(b"\n") + 1,
                column,
                f"byte 0x{data[error.start]:02x} is not UTF-8 text; save it as a CSV file in UTF-8",
            )
        return text.replace("\r\n", "\n").replace("\r", "\n")

    def _cells(self, number: int, line: str) -> list[tuple[int, str]]:
        """Return (column at which it begins, text) of each of the four cells of a line."""
        cells, at = [], 0
        for part in line.split(","):
            cells.append((at + 1 + len(part) - len(part.lstrip()), part.strip()))
            at += len(part) + 1
        if len(cells) < len(COLUMNS):
            self._refuse(
                number,
                len(line.rstrip()) + 1,
                f"{len(cells)} of the 4 values id,x,y,z; separate them by commas",
            )
        if len(cells) > len(COLUMNS):
            self._refuse(
                number,
                cells[len(COLUMNS)][0],
                f"{len(cells)} values; allowed are 4, id,x,y,z, with a point for decimals",
            )
        return cells

    def _header(self, number: int, cells: list[tuple[int, str]]) -> None:
        for (at, cell), name in zip(cells, COLUMNS, strict=True):
            match = _HEADER.fullmatch(cell)
            if match is None or match[1].lower() != name:
                self._refuse(number, at, f"{cell!r} where the header id,x,y,z has {name!r}")
            unit = match[2]
            if unit not in (None, "", "m") or (unit and name == "id"):
                self._refuse(number, at, f"{name} in {unit!r}; positions are in m: convert them")

    def _id(self, number: int, at: int, cell: str) -> int:
        try:
            id = int(cell)
        except ValueError:
            id = -1
        if not 0 <= id <= ID_MAX:
            self._refuse(number, at, f"id {cell!r}; allowed is an integer from 0 to {ID_MAX}")
        return id

    def _metres(self, number: int, at: int, name: str, cell: str) -> float:
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._refuse(number, at, f"{name} is {cell!r}; allowed is a finite number in m")
        return value

    def _refuse(self, line: int, column: int, why: str) -> NoReturn:
        raise MeasurementError(f"beacons {self._name}, line {line}, column {column}: {why}")
