"""Windows and instants of a replay, read from the mapped columns of its log.

Only the requested parts are read from the disk. It is thread-safe, because nothing changes after
opening.
"""

from __future__ import annotations

import json
import mmap
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from console.evaluation.spectrum import density_of, evenly, rotor_frequency, spectrogram_of
from extensions.replay.build import INDEX, TRACK, VERSION
from extensions.replay.samples import BIN, Samples, coarser
from flight_log.columns.log_columns import kept_columns
from flight_log.run import gaps, run_of
from quadrotor.errors import MeasurementError, OutOfBoundsError, StorageError
from vehicle_link.topics.measurements import PICTURE, decode_picture
from web.signals.evaluator import Made, count_before
from web.signals.signal import Array

MOST_SAMPLES = 2_000_000
"""Largest number of samples for one spectrum."""
MOST_COLUMNS = 300
"""Largest number of columns of a spectrogram."""
DETAIL = 2
"""Samples a point up to which each sample is drawn."""

Figures = dict[str, float | None]


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
        self._samples = Samples(self._run.topics, self.index["signals"])
        self.expressions = self._samples.expressions
        self._gaps = lru_cache(lambda topic: gaps(self._run.topics[topic].time))

    def described(self) -> dict[str, Any]:
        """Return the description for the page."""
        left_out, inner = {"version", "identity"}, ("column", "factor")
        fields = {name: value for name, value in self.index.items() if name not in left_out}
        fields["signals"] = [
            {name: value for name, value in row.items() if name not in inner}
            for row in self.index["signals"]
        ]
        return fields

    def statistics(self, names: Sequence[str], start: float, end: float) -> dict[str, Figures]:
        """Return mean, rms, min and max of all samples of each signal between two instants (s).

        `count` is the number of samples that have a value; without any the others are None.

        Raises OutOfBoundsError for an unknown signal.
        """
        found: dict[str, Figures] = {}
        for name in dict.fromkeys(names):
            times = self._samples.times(name)
            first, last = count_before(times, start), count_before(times, end)
            values = self._samples.values(name, first, last)
            known = values[np.isfinite(values)].astype(float, copy=False)
            figures: dict[str, Callable[[Array], Any]] = {
                "mean": np.mean,
                "rms": lambda one: np.sqrt(np.mean(one * one)),
                "min": np.min,
                "max": np.max,
            }
            found[name] = {"count": len(known)} | {
                figure: float(of(known)) if len(known) else None for figure, of in figures.items()
            }
        return found

    def window(
        self,
        names: Sequence[str],
        start: float,
        end: float,
        points: int,
        with_extremes: bool = True,
    ) -> bytes:
        """Return signals from start to end (s), each drawn with at most about `points` points.

        The answer has a JSON head and arrays, every part padded to a multiple of 8 bytes; little
        endian: uint32 length of the head, the head, and for each of its groups `count` float64
        times and for each of the group's signals `count` float32 values. Where there are many
        samples, two neighbouring values are the minimum and maximum of several, or, for
        `with_extremes` False, each is one of several, all signals' at the same time. NaN marks a
        gap.

        Raises OutOfBoundsError for an unknown signal.
        """
        groups: dict[int, list[str]] = {}
        for name in dict.fromkeys(names):
            groups.setdefault(id(self._samples.times(name)), []).append(name)
        head, parts = [], []
        for its in groups.values():
            times, columns = self._group(its, start, end, points, with_extremes)
            head.append({"signals": its, "count": len(times)})
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
            times = self._samples.times(name)
            index = count_before(times, t) - 1
            found[name] = [None, None]
            if index >= 0:
                value = float(self._samples.values(name, index, index + 1)[0])
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
        index = count_before(series.time, t) - 1
        if index < 0:
            return None
        return float(series.time[index]), decode_picture(series.payload(index))

    def _even(self, name: str, start: float, end: float) -> tuple[float, float, Array]:
        """Return the time of the first sample (s), the rate (Hz) and samples at it, (N, 1)."""
        times, values = self._between(name, start, end)
        known = np.isfinite(values)
        rate, even = evenly(times[known], values[known, None])
        return float(times[known][0]), rate, even

    def _rotors(self, start: float, end: float) -> list[tuple[Array, Array]]:
        """Return times (s) and revolutions a second of each rotor whose thrust is in the log."""
        names = [f"actuators/thrusts[{k}]" for k in range(4)]
        thrusts = [self._between(one, start, end) for one in names if self._samples.has(one)]
        return [(times, rotor_frequency(values)) for times, values in thrusts if len(values)]

    def _between(self, name: str, start: float, end: float) -> tuple[Array, Array]:
        times = self._samples.times(name)
        first, last = count_before(times, start), count_before(times, end)
        if last - first > MOST_SAMPLES:
            raise MeasurementError(
                f"{last - first} samples are too many for a spectrum, allowed are {MOST_SAMPLES}: "
                "zoom in"
            )
        return times[first:last], self._samples.values(name, first, last)

    def _group(
        self, names: list[str], start: float, end: float, points: int, with_extremes: bool
    ) -> tuple[Array, list[Array]]:
        """Return the times of signals that share them, and a column of each signal."""
        made: Made = {}
        times, its_gaps = self._samples.times(names[0]), self._gaps(self._samples.topic(names[0]))
        # One more sample on each side continues the lines to the window's edges.
        first = max(count_before(times, start) - 1, 0)
        last = min(count_before(times, end) + 1, len(times))
        count = max(last - first, 0)
        if count <= DETAIL * points or not with_extremes:
            step = 1 if with_extremes else max(1, -(-count // points))
            columns = [self._samples.values(one, first, last, made)[::step] for one in names]
            keys = np.arange(first, last, step)
            return _parted(times[keys], columns, keys, its_gaps)
        size = BIN if count // BIN >= points else 1
        low_bin, high_bin = first // size, -(-last // size)
        factor = -(-(high_bin - low_bin) // points)
        begins = np.arange(low_bin, high_bin, factor)
        ends = np.minimum(np.minimum(begins + factor, high_bin) * size, len(times)) - 1
        keys = np.stack([begins * size, ends], axis=1).ravel()
        columns = []
        for name in names:
            if size == 1:
                low = high = self._samples.values(name, first, last, made)
            else:
                low, high = self._samples.extremes(name, low_bin, high_bin)
            columns.append(np.stack(coarser(low, high, factor), axis=1).ravel())
        return _parted(times[keys], columns, keys, its_gaps)


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
