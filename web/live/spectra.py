"""Live spectra of what the flight loop sampled in the last seconds."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Annotated, Any

import numpy as np
from fastapi import FastAPI, Query

from console.evaluation.spectrum import density_of, evenly, rotor_frequency, spectrogram_of
from quadrotor.constants import MOTORS
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.json_object import JsonObject
from vehicle_link.topics.ticks import TICK_TOPICS
from web.live.signal_log import SignalLog
from web.live.telemetry import topic_of
from web.signals import INDEX
from web.signals.evaluator import count_before
from web.signals.expression import is_expression
from web.signals.signal import Array

SECONDS = 5.0
"""Seconds of telemetry of which a spectrum is made."""
SHORTEST = 2.0
"""Shortest telemetry, in s, from which a spectrum is made."""


@dataclass(frozen=True)
class Recent:
    """Samples of the last seconds: times (s of the page's frames), columns by signal, and the
    rotors' revolutions a second, (N,) each.
    """

    time: Array
    columns: dict[str, Array]
    turns: list[Array]


def recent(log: SignalLog, names: Sequence[str]) -> Recent:
    """Return the samples of the last SECONDS.

    Raises OutOfBoundsError for a signal that the flight loop does not sample, MeasurementError for
    less than SHORTEST.
    """
    for name in names:
        is_known = name in INDEX or is_expression(name)
        if not is_known or topic_of(name) not in TICK_TOPICS:
            known = "is not sampled at the flight rate" if is_known else "is not known"
            raise OutOfBoundsError(
                f"no live spectrum of {name!r:.80}, which {known}; signals of "
                f"{', '.join(TICK_TOPICS)} have one"
            )
    ticks = log.log("state")
    times = ticks.time if ticks else None
    first = 0 if times is None else count_before(times, log.now - SECONDS)
    seconds = 0.0 if times is None or first == len(times) else float(times[-1] - times[first])
    if times is None or seconds < SHORTEST:
        raise MeasurementError(
            f"{seconds:.1f} s of telemetry so far; a spectrum needs {SHORTEST:g} s"
        )
    columns = {name: log.values(name, first, len(times)).astype(float) for name in names}
    turns = [rotor_frequency(log.values(f"thrust.{m}", first, len(times))) for m in MOTORS]
    return Recent(times[first:].copy(), columns, turns)


def spectra(found: Recent) -> dict[str, Any]:
    """Return the spectra of signals as `extensions.replay.reader.Replay.spectra` does."""
    import_module("scipy.signal")  # slow once
    densities = []
    for name, column in found.columns.items():
        rate, even = _even(found.time, column)
        densities.append({"signal": name} | density_of(rate, even))
    return {"spectra": densities, "rotors": [round(float(one.mean()), 2) for one in found.turns]}


def live_spectrogram(found: Recent) -> dict[str, Any]:
    """Return the spectrogram of a signal as `extensions.replay.reader.Replay.spectrogram` does.

    Its times are those of the page's frames.
    """
    import_module("scipy.signal")
    [column] = found.columns.values()
    rate, even = _even(found.time, column)
    turns = [(found.time, one) for one in found.turns]
    return spectrogram_of(rate, even, float(found.time[0]), turns, len(even))


def _even(time: Array, values: Array) -> tuple[float, Array]:
    """Return the rate (Hz) and the samples that have a value, at even steps, (N, 1)."""
    known = np.isfinite(values)
    return evenly(time[known], values[known, None])


def add_spectra(app: FastAPI, log: SignalLog) -> None:
    @app.get("/api/spectrum")
    async def spectrum(
        signal: Annotated[list[str], Query(min_length=1, max_length=8)],
    ) -> dict[str, Any]:
        """Return spectra of the last 5 s of signals that the flight loop samples.

        `rotors` are the rotors' frequencies (Hz).
        """
        return await asyncio.to_thread(spectra, recent(log, list(dict.fromkeys(signal))))

    @app.get("/api/spectrogram")
    async def spectrogram(signal: str) -> JsonObject:
        """Return density over time and frequency of the last 5 s of a signal, and the rotors'."""
        return await asyncio.to_thread(live_spectrogram, recent(log, [signal]))
