"""Windows and instants of a replay, read from the mapped columns of its log.

Only the requested parts are read from the disk. It is thread-safe, because nothing changes after
opening.
"""

from __future__ import annotations

import json
import mmap
import struct
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from console.evaluation.spectrum import density_of, evenly, rotor_frequency, spectrogram_of
from flight_log.columns.log_columns import kept_columns
from flight_log.run import gaps, run_of
from quadrotor.errors import MeasurementError, OutOfBoundsError, StorageError
from vehicle_link.topics.measurements import PICTURE, decode_picture
from web.replay.build import INDEX, TRACK, VERSION
from web.replay.signals import derived, members_of

MOST_SAMPLES = 2_000_000
"""Largest number of samples for one spectrum."""
MOST_COLUMNS = 300
"""Largest number of columns of a spectrogram."""
DETAIL = 2
"""Samples a point up to which each sample is drawn."""
BIN = 16
"""Number of samples whose minimum and maximum are cached, to draw a whole flight."""
MOST_BINNED = 64
"""Number of columns whose extremes are cached: 300 kB each for 20 min at 500 Hz."""
PIECE = 1 << 16
"""Number of samples that are computed at once."""

Array = npt.NDArray[np.float64]
Extremes = tuple[Array, Array]
Made = dict[tuple[str, int, int], Sequence[Array]]
"""Signals that one answer has computed, by the first one of their source and the samples' range."""


class Replay:
    """Opened replay, of the log as it was when its columns were made.

    Raises StorageError if these are missing, or lack what the replay needs.
    """

    def __init__(self, log: Path) -> None:
        columns = kept_columns(log, np.float64)
        self.identity = columns.identity
        try:
            self.index: dict[str, Any] = json.loads((columns.folder / INDEX).read_text())
            with (columns.folder / TRACK).open("rb") as file:
                self.track = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise StorageError(f"the replay of {log.stem} cannot be read") from error
        if (self.index.get("version"), self.index.get("identity")) != (VERSION, self.identity):
            raise StorageError(f"the replay of {log.stem} is of another version")
        self._run = run_of(columns)
        made = derived(self._run.topics, members_of(self._run.topics)).values()
        self._made = {column: one for its in made for column, one in its.items()}
        self._signals = {row["name"]: row for row in self.index["signals"]}
        self._gaps = lru_cache(lambda topic: gaps(self._run.topics[topic].time))
        self._extremes = lru_cache(MOST_BINNED)(self._binned)

    def described(self) -> dict[str, Any]:
        """Return the description for the page."""
        left_out, inner = {"version", "identity"}, ("column", "factor")
        fields = {name: value for name, value in self.index.items() if name not in left_out}
        fields["signals"] = [
            {name: value for name, value in row.items() if name not in inner}
            for row in self.index["signals"]
        ]
        return fields

    def window(self, names: Sequence[str], start: float, end: float, points: int) -> bytes:
        """Return signals from start to end (s), each drawn with at most about `points` points.

        The answer has a JSON head and arrays, every part padded to a multiple of 8 bytes; little
        endian: uint32 length of the head, the head, and for each of its groups `count` float64
        times and for each of the group's signals `count` float32 values. Where there are many
        samples, two neighbouring values are the minimum and maximum of several. NaN marks a gap.

        Raises OutOfBoundsError for an unknown signal.
        """
        groups: dict[int, list[dict[str, Any]]] = {}
        for name in dict.fromkeys(names):
            row = self._row(name)
            groups.setdefault(id(self._times(row)), []).append(row)
        head, parts = [], []
        for rows in groups.values():
            times, columns = self._group(rows, start, end, points)
            head.append({"signals": [row["name"] for row in rows], "count": len(times)})
            parts += [times.astype("<f8", copy=False), *(one.astype("<f4") for one in columns)]
        for topic in self._run.log.topics.values():
            topic.release()
        text = json.dumps({"start": start, "end": end, "groups": head}).encode()
        return b"".join([struct.pack("<I", len(text)), text, bytes(-(4 + len(text)) % 8)]) + (
            b"".join(_padded(part) for part in parts)
        )

    def spectra(self, names: Sequence[str], start: float, end: float) -> dict[str, Any]:
        """Return the spectral density of each signal between two instants (s).

        The density is in the signal's unit/√Hz, two-sided as an estimator's white noise. `rotors`
        are the rotors' mean frequencies (Hz) from their thrusts; none if the log has no thrusts.

        Raises OutOfBoundsError for an unknown signal, MeasurementError for too few or too many
        samples.
        """
        found = []
        for name in dict.fromkeys(names):
            _, rate, even = self._even(name, start, end)
            found.append({"signal": name} | density_of(rate, even))
        rotors = [float(turns.mean()) for _, turns in self._rotors(start, end)]
        return {"spectra": found, "rotors": rotors}

    def spectrogram(self, name: str, start: float, end: float) -> dict[str, Any]:
        """Return the density of a signal over time (s of the run) and frequency.

        See `spectrogram_of`. Raises OutOfBoundsError and MeasurementError as `spectra` does.
        """
        first, rate, even = self._even(name, start, end)
        return spectrogram_of(rate, even, first, self._rotors(start, end), MOST_COLUMNS)

    def at(self, names: Sequence[str], t: float) -> dict[str, list[float | None]]:
        """Return each signal's newest value at t (s) and its age (s); None before the first."""
        found: dict[str, list[float | None]] = {}
        for name in names:
            row = self._row(name)
            times = self._times(row)
            index = _before(times, t) - 1
            found[name] = [None, None]
            if index >= 0:
                value = float(self._samples(row, index, index + 1)[0])
                age = t - float(times[index])
                found[name] = [value if np.isfinite(value) else None, round(age, 4)]
        return found

    def picture(self, topic: str, t: float) -> tuple[float, bytes] | None:
        """Return a camera's newest picture at t (s), a JPEG, and the time (s) of its capture.

        None before the first one.

        Raises OutOfBoundsError for a run without this camera, MeasurementError or LinkError for a
        message that is not a JPEG.
        """
        series = self._run.topics.get(topic)
        if series is None or series.type_name.replace("/msg/", "/") != PICTURE:
            there = [name for name in self._run.topics if name.endswith("_picture")]
            raise OutOfBoundsError(
                f"no pictures on {topic} in this run; it has {', '.join(there) or 'none at all'}"
            )
        index = _before(series.time, t) - 1
        if index < 0:
            return None
        return float(series.time[index]), decode_picture(series.payload(index))

    def _even(self, name: str, start: float, end: float) -> tuple[float, float, Array]:
        """Return the time of the first sample (s), the rate (Hz) and samples at it, (N, 1)."""
        times, values = self._between(self._row(name), start, end)
        known = np.isfinite(values)
        rate, even = evenly(times[known], values[known, None])
        return float(times[known][0]), rate, even

    def _rotors(self, start: float, end: float) -> list[tuple[Array, Array]]:
        """Return times (s) and revolutions a second of each rotor whose thrust is in the log."""
        rows = [self._signals.get(f"actuators/thrusts[{k}]") for k in range(4)]
        thrusts = [self._between(row, start, end) for row in rows if row is not None]
        return [(times, rotor_frequency(values)) for times, values in thrusts if len(values)]

    def _between(self, row: dict[str, Any], start: float, end: float) -> tuple[Array, Array]:
        times = self._times(row)
        first, last = _before(times, start), _before(times, end)
        if last - first > MOST_SAMPLES:
            raise MeasurementError(
                f"{last - first} samples are too many for a spectrum, allowed are {MOST_SAMPLES}: "
                "zoom in"
            )
        return times[first:last], self._samples(row, first, last)

    def _row(self, name: str) -> dict[str, Any]:
        row: dict[str, Any] | None = self._signals.get(name)
        if row is None:
            raise OutOfBoundsError(f"no signal {name!r:.80} in this run; its page lists them")
        return row

    def _times(self, row: dict[str, Any]) -> Array:
        return self._run.topics[row["topic"]].time

    def _samples(
        self, row: dict[str, Any], first: int, last: int, made: Made | None = None
    ) -> Array:
        """Return the samples of a signal with `first` <= index < `last`."""
        column = row["column"]
        if column in self._made:
            return self._make(column, first, last, {} if made is None else made)[
                self._made[column][2]
            ]
        series = self._run.topics[row["topic"]]
        samples: Array = series.values(column, first, last) * row["factor"]
        return samples

    def _make(self, column: str, first: int, last: int, made: Made) -> Sequence[Array]:
        """Return all signals of the source of a derived column."""
        source, names, _ = self._made[column]
        assert source.function is not None
        key = (source.signals[0].name, first, last)
        if key not in made:
            series = self._run.topics[source.topic]
            columns = [series.values(name, first, last) for name in names]
            inputs = [self._at(name, series.time, first, last, made) for name in source.inputs]
            with np.errstate(invalid="ignore", divide="ignore"):
                made[key] = source.function(np, *columns, *inputs)
        return made[key]

    def _at(self, name: str, times: Array, first: int, last: int, made: Made) -> Array:
        """Return a signal at times[first:last], interpolated; NaN outside of its samples."""
        row, wanted = self._row(name), times[first:last]
        its = self._times(row)
        if its is times or not len(wanted):
            return self._samples(row, first, last, made)
        begin = max(_before(its, wanted[0]) - 1, 0)
        end = min(_before(its, wanted[-1]) + 1, len(its))
        samples = self._samples(row, begin, end, made)
        between: Array = np.interp(wanted, its[begin:end], samples, left=np.nan, right=np.nan)
        return between

    def _binned(self, topic: str, column: str) -> list[Extremes]:
        """Return minimum and maximum of every BIN samples.

        They are of a column, or of all signals of the source of a derived one.
        """
        series = self._run.topics[topic]
        pieces: list[list[Extremes]] = []
        for first in range(0, len(series), PIECE):
            last = min(first + PIECE, len(series))
            if column in self._made:
                values = self._make(column, first, last, {})
            else:
                values = [series.values(column, first, last).astype(float, copy=False)]
            pieces.append([coarser(one, one, BIN) for one in values])
        return [
            (np.concatenate([low for low, _ in its]), np.concatenate([high for _, high in its]))
            for its in zip(*pieces, strict=True)
        ]

    def _group(
        self, rows: list[dict[str, Any]], start: float, end: float, points: int
    ) -> tuple[Array, list[Array]]:
        """Return the times of signals that share them, and a column of each signal."""
        made: Made = {}
        times, its_gaps = self._times(rows[0]), self._gaps(rows[0]["topic"])
        # One more sample on each side continues the lines to the window's edges.
        first = max(_before(times, start) - 1, 0)
        last = min(_before(times, end) + 1, len(times))
        count = max(last - first, 0)
        if count <= DETAIL * points:
            columns = [self._samples(row, first, last, made) for row in rows]
            return _parted(times[first:last], columns, np.arange(first, last), its_gaps)
        size = BIN if count // BIN >= points else 1
        low_bin, high_bin = first // size, -(-last // size)
        factor = -(-(high_bin - low_bin) // points)
        begins = np.arange(low_bin, high_bin, factor)
        ends = np.minimum(np.minimum(begins + factor, high_bin) * size, len(times)) - 1
        keys = np.stack([begins * size, ends], axis=1).ravel()
        columns = []
        for row in rows:
            if size == 1:
                low = high = self._samples(row, first, last, made)
            else:
                low, high = self._bins(row, low_bin, high_bin)
            columns.append(np.stack(coarser(low, high, factor), axis=1).ravel())
        return _parted(times[keys], columns, keys, its_gaps)

    def _bins(self, row: dict[str, Any], first: int, last: int) -> Extremes:
        column, factor = row["column"], row["factor"]
        source, _, place = self._made.get(column, (None, [], 0))
        key = f"@{source.signals[0].name}" if source else column
        low, high = (factor * bins[first:last] for bins in self._extremes(row["topic"], key)[place])
        return (low, high) if factor >= 0.0 else (high, low)


def _before(times: Array, t: float) -> int:
    """Return the number of times at or before t."""
    return int(np.searchsorted(times, t, side="right"))


def coarser(low: Array, high: Array, factor: int) -> tuple[Array, Array]:
    """Return bins of `factor` values, the last of the remainder; NaN only if all are NaN."""
    if factor <= 1 or len(low) == 0:
        return low, high
    begins = np.arange(0, len(low), factor)
    return np.fmin.reduceat(low, begins), np.fmax.reduceat(high, begins)


def _parted(
    times: Array, columns: list[Array], keys: npt.NDArray[np.int64], gaps: npt.NDArray[np.int64]
) -> tuple[Array, list[Array]]:
    """Insert a NaN between the points on both sides of a gap; `keys` are the samples' indices."""
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
