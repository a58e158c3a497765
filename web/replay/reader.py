"""Windows and instants out of a replay's cache: only what is asked for is read from the disk.

Thread-safe: reading is by place (pread), and nothing is changed after opening.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from console.evaluation.spectrum import (
    SEGMENT,
    SEGMENTS_MIN,
    evenly,
    rotor_frequency,
    spectrogram,
    spectrum,
)
from quadrotor.errors import MeasurementError, OutOfBoundsError, StorageError
from web.replay.cache_writer import COLUMNS, INDEX, TRACK, VERSION
from web.replay.pyramid import FACTOR, coarser, level_sizes

STRIDE = 512
"""Every so many times are kept in memory; between them, one read finds the place."""
MOST_SAMPLES = 2_000_000
"""Of a signal, under one spectrum."""
MOST_COLUMNS = 300
"""Of a spectrogram; of more, neighbours are averaged."""
DETAIL = 2
"""Samples a point are drawn one by one."""

Times = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]


class _Base:
    """The times of one or several topics, s since the run's start, in order."""

    def __init__(self, replay: Replay, fields: dict[str, Any]) -> None:
        self.count: int = fields["count"]
        self.edges: list[int] = fields["edges"]
        self.gaps = np.array(fields["gaps"], np.int64)
        self._replay = replay
        self._place: int = fields["times"]
        self._every = np.array(
            [self.times(k, k + 1)[0] for k in range(0, self.count, STRIDE)], float
        )

    def times(self, first: int, last: int) -> Times:
        return self._replay.read(self._place + 8 * first, last - first, np.float64)

    def before(self, t: float) -> int:
        """Return how many times are at or before t."""
        block = int(np.searchsorted(self._every, t, side="right")) - 1
        if block < 0:
            return 0
        first = block * STRIDE
        times = self.times(first, min(first + STRIDE, self.count))
        return first + int(np.searchsorted(times, t, side="right"))


class Replay:
    """An opened cache. Raises StorageError when it is damaged or of another version."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self.index: dict[str, Any] = json.loads((folder / INDEX).read_text())
            self._file = os.open(folder / COLUMNS, os.O_RDONLY | os.O_CLOEXEC)
        except (OSError, ValueError) as error:
            raise StorageError(f"the replay's cache {folder.name} cannot be read") from error
        if self.index.get("version") != VERSION:
            os.close(self._file)
            raise StorageError(f"the replay's cache {folder.name} is of another version")
        self._bases = [_Base(self, fields) for fields in self.index["bases"]]
        self._signals = {row["name"]: row for row in self.index["signals"]}

    def __del__(self) -> None:
        if hasattr(self, "_file"):
            os.close(self._file)

    @property
    def track(self) -> Path:
        return self.folder / TRACK

    def described(self) -> dict[str, Any]:
        """Return the description for the page: everything but the places in the file."""
        left_out = {"bases", "topics", "signals", "version"}
        fields = {name: value for name, value in self.index.items() if name not in left_out}
        inner = ("column", "factor")
        return {
            **fields,
            "signals": [
                {name: value for name, value in row.items() if name not in inner}
                for row in self.index["signals"]
            ],
            "topics": {
                name: {"type": topic["type"], "count": topic["count"]}
                for name, topic in self.index["topics"].items()
            },
        }

    def window(self, names: Sequence[str], start: float, end: float, points: int) -> bytes:
        """Return signals from start to end (s), each drawn by about `points` places at most.

        A JSON head and arrays, every part padded to a multiple of 8 bytes; little endian:
        uint32 length of the head, the head, and for each of its groups `count` float64 times and
        for each of the group's signals `count` float32 values. Where samples are many, two
        neighbouring values are the least and the greatest of some. NaN parts what is apart.

        Raises OutOfBoundsError for an unknown signal.
        """
        groups: dict[int, list[dict[str, Any]]] = {}
        for name in dict.fromkeys(names):
            row = self._row(name)
            groups.setdefault(self.index["topics"][row["topic"]]["base"], []).append(row)
        head, parts = [], []
        for base, rows in groups.items():
            times, columns = self._group(self._bases[base], rows, start, end, points)
            head.append({"signals": [row["name"] for row in rows], "count": len(times)})
            parts += [times.astype("<f8", copy=False), *columns]
        text = json.dumps({"start": start, "end": end, "groups": head}).encode()
        return b"".join([struct.pack("<I", len(text)), text, bytes(-(4 + len(text)) % 8)]) + (
            b"".join(_padded(part) for part in parts)
        )

    def spectra(self, names: Sequence[str], start: float, end: float) -> dict[str, Any]:
        """Return the density of each signal between two instants (s), in its unit/√Hz as an
        estimator's white noise has it (two-sided), and the rotors' mean frequencies (Hz) by their
        thrusts, none where the log has no thrusts.

        Raises OutOfBoundsError for an unknown signal, MeasurementError for too few or too many
        samples.
        """
        found = []
        for name in dict.fromkeys(names):
            _, rate, even = self._even(name, start, end)
            segment = min(SEGMENT, len(even) / rate / SEGMENTS_MIN)
            frequency, density = spectrum(rate, even, segment)
            root = np.sqrt(0.5 * density[:, 0])
            found.append(
                {
                    "signal": name,
                    "frequency": frequency.round(4).tolist(),
                    "density": [float(f"{one:.4g}") for one in root],
                }
            )
        rotors = [float(turns.mean()) for _, turns in self._rotors(start, end)]
        return {"spectra": found, "rotors": rotors}

    def spectrogram(self, name: str, start: float, end: float) -> dict[str, Any]:
        """Return the density of a signal over time and frequency, as `spectra` does: times (T,) in
        s of the run, frequencies (M,) in Hz, `density` (T, M), and the rotors' frequencies (4, T).

        Raises OutOfBoundsError and MeasurementError as `spectra` does.
        """
        first, rate, even = self._even(name, start, end)
        time, frequency, density = spectrogram(rate, even)
        apart = -(-len(time) // MOST_COLUMNS)
        edges = np.arange(0, len(time), apart)
        counts = np.diff(edges, append=len(time))
        time = first + np.add.reduceat(time, edges) / counts
        root = np.sqrt(0.5 * np.add.reduceat(density[:, 0], edges, axis=1) / counts)
        return {
            "times": time.round(4).tolist(),
            "frequency": frequency.round(4).tolist(),
            "density": [[float(f"{one:.3g}") for one in column] for column in root.T.tolist()],
            "rotors": [
                np.interp(time, at, turns).round(2).tolist()
                for at, turns in self._rotors(start, end)
            ],
        }

    def at(self, names: Sequence[str], t: float) -> dict[str, list[float | None]]:
        """Return newest value at t (s) and its age (s) of each signal; None before the first
        one.
        """
        places: dict[int, tuple[int, float | None]] = {}
        found: dict[str, list[float | None]] = {}
        for name in names:
            row = self._row(name)
            number = self.index["topics"][row["topic"]]["base"]
            if number not in places:
                base = self._bases[number]
                index = base.before(t) - 1
                age = t - float(base.times(index, index + 1)[0]) if index >= 0 else None
                places[number] = (index, age)
            index, age = places[number]
            value = None
            if index >= 0:
                raw = float(self._values(row, index, index + 1)[0]) * row["factor"]
                value = raw if np.isfinite(raw) else None
            found[name] = [value, None if age is None else round(age, 4)]
        return found

    def read(self, place: int, count: int, dtype: Any) -> npt.NDArray[Any]:
        """Return `count` numbers of `columns.bin`. Raises StorageError when it is cut off."""
        kind = np.dtype(dtype)
        data = os.pread(self._file, count * kind.itemsize, place)
        if len(data) != count * kind.itemsize:
            raise StorageError(f"the replay's cache {self.folder.name} is cut off; open it again")
        return np.frombuffer(data, kind)

    def _even(self, name: str, start: float, end: float) -> tuple[float, float, Times]:
        """Return the time of the first sample (s), the rate (Hz) and samples at it, (N, 1)."""
        times, values = self._samples(self._row(name), start, end)
        known = np.isfinite(values)
        rate, even = evenly(times[known], values[known, None])
        return float(times[known][0]), rate, even

    def _rotors(self, start: float, end: float) -> list[tuple[Times, Times]]:
        """Return times (s) and turns a second of each rotor whose thrust the log has."""
        rows = [self._signals.get(f"actuators/thrusts[{k}]") for k in range(4)]
        thrusts = [self._samples(row, start, end) for row in rows if row is not None]
        return [(times, rotor_frequency(values)) for times, values in thrusts if len(values)]

    def _samples(self, row: dict[str, Any], start: float, end: float) -> tuple[Times, Floats]:
        base = self._bases[self.index["topics"][row["topic"]]["base"]]
        first, last = base.before(start), base.before(end)
        if last - first > MOST_SAMPLES:
            raise MeasurementError(
                f"{last - first} samples are too many for a spectrum, allowed are {MOST_SAMPLES}: "
                "zoom in"
            )
        values = self._values(row, first, last) * np.float32(row["factor"])
        return base.times(first, last), values

    def _row(self, name: str) -> dict[str, Any]:
        row: dict[str, Any] | None = self._signals.get(name)
        if row is None:
            raise OutOfBoundsError(f"no signal {name!r:.80} in this run; its page lists them")
        return row

    def _group(
        self, base: _Base, rows: list[dict[str, Any]], start: float, end: float, points: int
    ) -> tuple[Times, list[Floats]]:
        # One sample more on each side, so that lines run on to the window's edges.
        first = max(base.before(start) - 1, 0)
        last = min(base.before(end) + 1, base.count)
        count = max(last - first, 0)
        if count <= DETAIL * points:
            keys = np.arange(first, last)
            times = base.times(first, last)
            columns = [self._values(row, first, last) * np.float32(row["factor"]) for row in rows]
            return _parted(times, columns, keys, base.gaps)
        level = 0
        while level < len(base.edges) and count // FACTOR ** (level + 1) >= points:
            level += 1
        size = FACTOR**level
        low_bin, high_bin = first // size, -(-last // size)
        factor = -(-(high_bin - low_bin) // points)
        begins, ends = self._edges(base, level, low_bin, high_bin)
        picked = np.arange(0, high_bin - low_bin, factor)
        closing = np.minimum(picked + factor, high_bin - low_bin) - 1
        times = np.stack([begins[picked], ends[closing]], axis=1).ravel()
        keys = np.stack(
            [(low_bin + picked) * size, np.minimum((low_bin + closing + 1) * size, base.count) - 1],
            axis=1,
        ).ravel()
        columns = []
        for row in rows:
            low, high = self._level(row, base, level, low_bin, high_bin)
            both = np.stack(coarser(low, high, factor), axis=1).ravel()
            columns.append(both * np.float32(row["factor"]))
        return _parted(times, columns, keys, base.gaps)

    def _edges(self, base: _Base, level: int, first: int, last: int) -> tuple[Times, Times]:
        if level == 0:
            times = base.times(first, last)
            return times, times
        place, bins = base.edges[level - 1], -(-base.count // FACTOR**level)
        return (
            self.read(place + 8 * first, last - first, np.float64),
            self.read(place + 8 * (bins + first), last - first, np.float64),
        )

    def _level(
        self, row: dict[str, Any], base: _Base, level: int, first: int, last: int
    ) -> tuple[Floats, Floats]:
        """Return least and greatest of the bins; with a negative factor they change places."""
        if level == 0 or "constant" in self._column(row):
            values = self._values(row, first, last)
            return values, values
        place = self._column(row)["levels"][level - 1]
        bins = level_sizes(base.count)[level - 1]
        return (
            self.read(place + 4 * first, last - first, np.float32),
            self.read(place + 4 * (bins + first), last - first, np.float32),
        )

    def _values(self, row: dict[str, Any], first: int, last: int) -> Floats:
        column = self._column(row)
        if "constant" in column:
            value = np.nan if column["constant"] is None else column["constant"]
            return np.full(last - first, value, np.float32)
        return self.read(column["at"] + 4 * first, last - first, np.float32)

    def _column(self, row: dict[str, Any]) -> dict[str, Any]:
        column: dict[str, Any] = self.index["topics"][row["topic"]]["columns"][row["column"]]
        return column


def _parted(
    times: Times, columns: list[Floats], keys: npt.NDArray[np.int64], gaps: npt.NDArray[np.int64]
) -> tuple[Times, list[Floats]]:
    """Insert a NaN between the points on both sides of a gap; `keys`: samples' indices."""
    inside = gaps[(gaps >= keys[0]) & (gaps < keys[-1])] if len(keys) else gaps[:0]
    places = np.unique(np.searchsorted(keys, inside, side="right"))
    places = places[(places > 0) & (places < len(keys))]
    if len(places) == 0:
        return times, columns
    between = 0.5 * (times[places - 1] + times[places])
    return (
        np.insert(times, places, between),
        [np.insert(column, places, np.nan) for column in columns],
    )


def _padded(part: npt.NDArray[Any]) -> bytes:
    data = part.tobytes()
    return data + bytes(-len(data) % 8)
