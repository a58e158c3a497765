"""The verdict on a run after its back-fill: complete, filled, or how much is missing still and
why.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from console.catalogue.completeness import WORTH_TELLING, Completeness, State
from console.transfers.source import EDGE_NS, Source, Span, together
from console.transfers.vehicle_files import VehicleFile


def judged(
    found: dict[str, Any], sources: Sequence[Source], on_board: Sequence[VehicleFile]
) -> Completeness:
    """Return what the run is after filling."""
    period = found["period_ns"]
    missing, stretches = 0, {one["name"]: one for one in found["stretches"]}
    covered: list[Span] = []
    for source in sources:
        its = stretches.get(source.file.name)
        if source.count is not None and its is not None:
            missing += max(0, source.count - its["in_run"])
            covered.append((its["first_ns"], its["last_ns"]))
        else:
            covered += [*source.spans]
    spoiled = [] if any(s.count is not None for s in sources) else found["damaged"]
    uncounted = 0
    for begin, end, is_armed in found["holes"]:
        known = covered
        if sources and not is_armed:  # the vehicle logs only while it is armed
            known = [*covered, *_disarmed(sources, end)]
        uncounted += _ticks_missing((begin, end), known, spoiled, period)
    missing += uncounted
    seconds = period * 1e-9
    total = (found["all_ticks"] + missing) * seconds
    filled = found["filled_ticks"] * seconds
    if missing:
        if found["damaged"]:
            why = "the vehicle's log of it is damaged"
        elif on_board and all(one.start_ns > found["holes"][0][0] for one in on_board):
            why = "the vehicle's log of it was overwritten"
        elif not any(armed for _, _, armed in found["holes"]):
            why = "the vehicle was not armed, and logged nothing"
        else:
            why = "the vehicle has no log of it"
        return Completeness("missing", filled, missing * seconds, total, why)
    if not found["all_ticks"]:
        return Completeness("unknown", why="no tick of the vehicle is in it")
    if sources:
        why = f"{found['all_ticks']} ticks, compared with the vehicle's log"
    else:
        why = "no hole in it; the vehicle logged nothing meanwhile"
    state: State = "filled" if filled >= WORTH_TELLING else "complete"
    return Completeness(state, filled, 0.0, total, why)


def _disarmed(sources: Sequence[Source], end: int) -> list[Span]:
    """Return the span from the end of the vehicle's log on."""
    ended = [source.file.end_ns for source in sources if source.file.end_ns < end]
    return [(max(ended) - EDGE_NS, end)] if ended else []


def _ticks_missing(
    hole: Span, covered: Sequence[Span], spoiled: Sequence[Span], period: int
) -> int:
    """Return how many ticks of a hole are missing, except where the vehicle's log shows that it has
    none there either.
    """
    begin, end = hole
    known = 0
    for first, last in together([span for span in covered if span[0] < end and span[1] > begin]):
        known += max(0, min(last, end) - max(first, begin))
    for first, last in spoiled:
        known -= max(0, min(last, end) - max(first, begin))
    unknown = (end - begin) - max(0, known)
    if unknown <= period:
        return 0
    return max(1, round(unknown / period) - (1 if known <= 0 else 0))
