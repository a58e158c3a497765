"""Findings that can follow from others: off reference, saturated, inconsistent, tilted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import (
    AT_BOUND,
    HELD,
    NEARLY,
    Finding,
    Parameters,
    Spans,
    Topics,
    flagged,
    stretches,
    within,
)
from extensions.explanation.blocks import (
    SETTLING,
    blocks,
    distances,
    has,
    longest,
    means,
    number,
    overlaps,
    tilts,
)
from flight_log.fields import POSITION, REFERENCE

OSCILLATING = "oscillating"
"""Flag of swings about the reference that grow or go on."""
OFF_REFERENCE = 0.25
"""Limit in m between estimate and reference."""
SATURATED = 0.1
"""Limit of the saturated share of the time."""
INCONSISTENT, REFUSED = 4.0, 0.2
"""Limits of the mean normalised innovation squared, and of the share of refused measurements."""
TILT = 70.0
"""Limit in deg, for logs without the vehicle's own limit."""


def off_reference(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find where the vehicle was far from its reference, other than by a step or doublet."""
    if not has(topics, "state", *POSITION) or not has(topics, "reference", *REFERENCE):
        return
    state, wanted = topics["state"], topics["reference"]
    distance = distances(state, POSITION, wanted, REFERENCE)
    excited = [(start, end + SETTLING) for start, end in flagged(topics, "excite", "behavior")]
    inside = within(state.time, spans) & ~within(state.time, excited) & (distance > OFF_REFERENCE)
    if not inside.any():
        return
    most, times = float(distance[inside].max()), state.time[inside]
    yield Finding(
        "off_reference",
        most / OFF_REFERENCE,
        start=float(times[0]),
        end=float(times[-1]),
        claim=f"The vehicle was up to {most:.2f} m off its reference (limit {OFF_REFERENCE:g} m).",
        signals=("error.distance",),
        label="distance from the reference",
        unit="m",
        limit=OFF_REFERENCE,
        time=state.time,
        values=distance,
        follows=True,
    )


def saturation(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find where the motors could not produce the requested wrench."""
    if not has(topics, "actuators", "scaling"):
        return
    series = topics["actuators"]
    scaling = series.values("scaling")
    limited = (scaling < 1.0).astype(float)[:, None]
    time, share = blocks(series.time, limited, spans, means, 1.0)
    for start, end in longest(time, share[:, 0], SATURATED, 1, 1.0):
        inside = (series.time >= start) & (series.time < end)
        most = float(np.max(share[(time >= start) & (time < end), 0]))
        yield Finding(
            "saturation",
            most / SATURATED,
            start=start,
            end=end,
            claim=f"Motors were saturated for up to {100 * most:.0f} % of a second; the wrench was "
            f"scaled down to {float(np.nanmin(scaling[inside])):.2f}.",
            signals=("scaling",),
            label="scaling of the wrench",
            unit="",
            limit=1.0,
            time=series.time,
            values=scaling,
            follows=True,
        )


def inconsistent(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find an estimate that its measurements contradict."""
    if not has(topics, "estimator", "consistency", "refused_share"):
        return
    series = topics["estimator"]
    nis, refused = series.values("consistency"), series.values("refused_share")
    weight = np.fmax(np.nan_to_num(nis) / INCONSISTENT, np.nan_to_num(refused) / REFUSED)
    time, mean = blocks(series.time, weight[:, None], spans, means, 1.0)
    for start, end in longest(time, mean[:, 0], 1.0, 1, 1.0):
        inside = (series.time >= start) & (series.time < end)
        most = float(mean[(time >= start) & (time < end), 0].max())
        parts = []
        if np.isfinite(nis[inside]).any():
            parts.append(
                f"innovation squared up to {np.nanmax(nis[inside]):.1f} times the expected"
            )
        if np.isfinite(refused[inside]).any():
            parts.append(f"up to {100 * np.nanmax(refused[inside]):.0f} % refused")
        yield Finding(
            "estimate_inconsistent",
            most,
            start=start,
            end=end,
            claim=f"The measurements contradicted the estimate: {', '.join(parts)}.",
            signals=("consistency", "refused.share"),
            label="innovation squared or share refused, over its limit",
            unit="",
            limit=1.0,
            time=series.time,
            values=weight,
            follows=True,
        )


def at_bound(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find biases, integrals and estimates that their bounds held for more than a second."""
    biases = {
        f"estimation.{sensor}_bias_limit": tuple(f"{sensor}_bias.{axis}" for axis in "xyz")
        for sensor in ("gyroscope", "accelerometer")
    }
    held: Spans = []
    names = []
    for name, fields in biases.items():
        if has(topics, "estimator", *fields) and name in parameters:
            series = topics["estimator"]
            largest = np.abs(series.rows(fields)).max(axis=1)
            at = largest >= NEARLY * number(parameters, name, np.inf)
            found = [one for one in stretches(series.time, at) if one[1] - one[0] > HELD]
            names += [name] if found else []
            held += found
    held = [one for one in held + flagged(topics, AT_BOUND) if overlaps(spans, *one)]
    if not held:
        return
    held = sorted(held)
    lasted = max(end - start for start, end in held)
    which = f" ({', '.join(names)})" if names else "; the events say which"
    yield Finding(
        AT_BOUND,
        max(1.0, lasted / HELD),
        start=held[0][0],
        end=max(end for _, end in held),
        claim=f"A bias, an integral or an estimate was at its bound for up to {lasted:.1f} "
        f"s{which}: what the flight needs is beyond it.",
        signals=tuple(biases[names[0]]) if names else (),
        label="at its bound",
        unit="0 or 1",
        limit=0.5,
        time=np.repeat(np.ravel(held), 2),
        values=np.tile([0.0, 1.0, 1.0, 0.0], len(held)),
        follows=True,
    )


def oscillating(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find where the vehicle told that it oscillates."""
    told = [one for one in flagged(topics, OSCILLATING) if overlaps(spans, *one)]
    if not told:
        return
    series = topics["status"]
    start, end = told[0][0], max(end for _, end in told)
    at = ""
    frequency = np.zeros(len(series), np.float32)
    if has(topics, "status", "oscillation_frequency"):
        frequency = series.values("oscillation_frequency").astype(np.float32)
        found = frequency[within(series.time, told) & (frequency > 0.0)]
        at = f" at {float(np.median(found)):.1f} Hz" if len(found) else ""
    lasted = sum(end - start for start, end in told)
    yield Finding(
        OSCILLATING,
        max(1.0, lasted),
        start=start,
        end=end,
        claim=f"The vehicle oscillated{at} for {lasted:.1f} s; the events say in which axis.",
        signals=("error.distance",),
        label="frequency of the oscillation",
        unit="Hz",
        limit=0.0,
        time=series.time,
        values=frequency,
        follows=True,
    )


def tilted(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a tilt that no manoeuvre needs."""
    time, tilt = tilts(topics)
    limit = number(parameters, "safety.tilt_max", TILT)
    # Flights may end with a fall.
    longer = [(start - SETTLING, end + SETTLING) for start, end in spans]
    inside = within(time, longer) & (tilt > limit)
    if not inside.any():
        return
    most, times = float(tilt[inside].max()), time[inside]
    yield Finding(
        "tilted",
        most / limit,
        start=float(times[0]),
        end=float(times[-1]),
        claim=f"The vehicle tilted by {most:.0f}°, more than its limit of {limit:.0f}°.",
        signals=("state.roll", "state.pitch"),
        label="tilt",
        unit="°",
        limit=limit,
        time=time,
        values=tilt,
        follows=True,
    )
