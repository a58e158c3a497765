"""Live spectra of what the flight loop sampled in the last seconds."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from fastapi import FastAPI, Query

from console.evaluation.spectrum import density_of, evenly, rotor_frequency, spectrogram_of
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.records import TICK, Record
from vehicle_link.messages.cdr_layout import Records
from vehicle_link.telemetry import unpack
from vehicle_link.topics import actuator_messages, imu_messages, reference_messages, state_messages
from web.access.requester import Asker
from web.live.station import Station
from web.signals import NAMED_SOURCES, SIGNALS, Source
from web.signals.plain import sources_of

Array = npt.NDArray[np.float64]

SHORTEST = 2.0
"""Shortest telemetry, in s, from which a spectrum is made."""
MESSAGES: dict[str, Callable[[Record, str], Records]] = {
    "state": state_messages,
    "reference": lambda ticks, vehicle: reference_messages(ticks),
    "imu": imu_messages,
    "actuators": lambda ticks, vehicle: actuator_messages(ticks),
}
"""Topics that have a sample for every tick of the flight loop."""
_SOURCES: dict[str, tuple[Source, int]] = {
    signal.name: (source, k)
    for source in (*(one for topic in MESSAGES for one in sources_of(topic, ())), *NAMED_SOURCES)
    for k, signal in enumerate(source.signals)
}
_KNOWN = {signal.name for signal in SIGNALS}


class TickSignals:
    """Signals of the page for each of N ticks.

    Args:
        ticks: TICK records, shape (N,).

    Attributes:
        start: the vehicle's time at the first tick, s.
        time: time since then, (N,), s.
        turns: revolutions of the rotors a second, (4, N).
    """

    def __init__(self, ticks: Record, vehicle: str) -> None:
        self._ticks, self._vehicle = ticks, vehicle
        self._messages: dict[str, Records] = {}
        stamps = ticks["imu"]["stamp_ns"]
        self.start = 1e-9 * float(stamps[0]) if len(stamps) else 0.0
        self.time: Array = 1e-9 * (stamps - stamps[:1])
        self.turns: Array = rotor_frequency(ticks["actuators"]["thrusts"]).T

    def values(self, name: str) -> Array:
        """Return a signal, shape (N,), in its own unit.

        Raises OutOfBoundsError when the telemetry does not have it.
        """
        source, place = _SOURCES.get(name, (None, 0))
        if source is None or source.topic not in MESSAGES:
            known = "is not sampled at the flight rate" if name in _KNOWN else "is not known"
            raise OutOfBoundsError(
                f"no live spectrum of {name!r:.80}, which {known}; signals of "
                f"{', '.join(MESSAGES)} have one"
            )
        if source.function is None:
            return source.factors[place] * self._column(source.topic, source.columns[place])
        columns = [self._column(source.topic, column) for column in source.columns]
        inputs = [self.values(one) for one in source.inputs]
        values: Array = np.asarray(source.function(np, *columns, *inputs)[place])
        return values

    def _column(self, topic: str, path: str) -> Array:
        if topic not in self._messages:
            self._messages[topic] = MESSAGES[topic](self._ticks, self._vehicle)
        records = self._messages[topic]
        if path in (records.dtype.names or ()):
            return records[path].astype(np.float64)
        found = re.fullmatch(r"(.+?)(?:\.([xyzw])|\[(\d+)\])", path)
        if found is None or found[1] not in (records.dtype.names or ()):
            raise OutOfBoundsError(f"no live spectrum of {path!r:.80}: it does not change")
        index = "xyzw".index(found[2]) if found[2] else int(found[3])
        return records[found[1]][:, index].astype(np.float64)


def signals_of(packets: bytes, lengths: Sequence[int], vehicle: str) -> TickSignals:
    """Return the signals of packets of telemetry, each tick once.

    Args:
        packets: quadlab_msgs/Telemetry messages, concatenated.
        lengths: bytes of each.

    Raises MeasurementError for less than SHORTEST.
    """
    import_module("scipy.signal")  # slow once, while the station collects telemetry
    ends = np.cumsum(lengths, dtype=np.int64).tolist()
    parts = [unpack(packets[end - size : end])[1] for end, size in zip(ends, lengths, strict=True)]
    ticks = np.concatenate(parts) if parts else np.zeros(0, TICK)
    _, first = np.unique(ticks["imu"]["stamp_ns"], return_index=True)
    signals = TickSignals(ticks[first], vehicle)
    seconds = float(signals.time[-1]) if len(first) else 0.0
    if seconds < SHORTEST:
        raise MeasurementError(
            f"{seconds:.1f} s of telemetry so far; a spectrum needs {SHORTEST:g} s"
        )
    return signals


def spectra(signals: TickSignals, names: Sequence[str]) -> dict[str, Any]:
    """Return the spectra of signals as `web.replay.reader.Replay.spectra` does.

    Raises OutOfBoundsError for an unknown signal.
    """
    found = []
    for name in dict.fromkeys(names):
        rate, even = evenly(signals.time, signals.values(name)[:, None])
        found.append({"signal": name} | density_of(rate, even))
    return {"spectra": found, "rotors": signals.turns.mean(axis=1).round(2).tolist()}


def live_spectrogram(signals: TickSignals, name: str) -> dict[str, Any]:
    """Return the spectrogram of a signal as `web.replay.reader.Replay.spectrogram` does.

    Its times are the vehicle's; `newest` is that of the newest sample (s).

    Raises OutOfBoundsError for an unknown signal.
    """
    rate, even = evenly(signals.time, signals.values(name)[:, None])
    turns = [(signals.time, one) for one in signals.turns]
    found = spectrogram_of(rate, even, 0.0, turns, len(even))
    stamps = [round(signals.start + time, 4) for time in found["times"]]
    return found | {"times": stamps, "newest": signals.start + float(signals.time[-1])}


def add_spectra(app: FastAPI, station: Station, vehicle: str) -> None:
    async def recent(asker: Asker) -> TickSignals:
        answer = await station.command("recent_telemetry", asker.label)
        packets, lengths = answer.packets.tobytes(), answer.lengths.tolist()
        return await asyncio.to_thread(signals_of, packets, lengths, vehicle)

    @app.get("/api/spectrum")
    async def spectrum(
        asker: Asker, signal: Annotated[list[str], Query(min_length=1, max_length=8)]
    ) -> dict[str, Any]:
        """Return spectra of the last 5 s of signals that the flight loop samples.

        `rotors` are the rotors' frequencies (Hz). The station collects telemetry from the first
        request on.
        """
        return await asyncio.to_thread(spectra, await recent(asker), signal)

    @app.get("/api/spectrogram")
    async def spectrogram(asker: Asker, signal: str) -> dict[str, Any]:
        """Return the spectrogram of the last 5 s of a signal, as `/api/spectrum` does."""
        return await asyncio.to_thread(live_spectrogram, await recent(asker), signal)
