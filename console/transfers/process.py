"""Looking at a run and filling it: jobs of the station (vehicle_link.jobs)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from flight_log.fill import filled_before, write_filled
from flight_log.fill_source import FillSource
from flight_log.filling import Filling
from flight_log.run_index import index_run


def look(run: Path) -> dict[str, Any]:
    """Return what a run has. Times in ns of the vehicle's clock."""
    index = index_run(run)
    ticks = index.ticks
    return {
        "ticks": len(ticks),
        "period_ns": index.period_ns,
        "holes": index.holes(),
        "gaps": index.gaps(),
        "first_ns": int(ticks[0]) if len(ticks) else 0,
        "last_ns": int(ticks[-1]) if len(ticks) else 0,
        "delay_ns": index.delay_ns,
        "began_ns": index.first_received_ns - index.delay_ns,
        "ended_ns": index.last_received_ns - index.delay_ns,
    }


def fill(
    run: Path,
    sources: Sequence[FillSource],
    since_ns: int,
    until_ns: int,
    told: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return what `sources` have that the run lacks; with `told` to keep in it, fill it in."""
    index = index_run(run)
    filling = Filling(index, sources, since_ns, until_ns)
    found = filling.look()
    before = filled_before(index)
    files = sorted({*before["files"], *(source.name for source in sources)})
    ticks = before["ticks"] + found.ticks
    answer = {**asdict(found), "filled_ticks": ticks, "files": files}
    if found.messages and told is not None:
        kept = {
            "files": json.dumps(files),
            "messages": str(before["messages"] + found.messages),
            "ticks": str(ticks),
            "seconds": f"{ticks * found.period_ns * 1e-9:.3f}",
            **told,
        }
        write_filled(run, index, filling, kept)
    return answer
