"""The completeness of runs in the catalogue: whether each has every tick that the
vehicle logged.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal

from sqlalchemy import select

from console.catalogue.search import NOT_DELETED
from console.catalogue.tables import CompletenessRow, RunEntry
from quadrotor.json_object import JsonObject

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue

State = Literal["open", "complete", "filled", "missing", "unknown"]
"""State of a comparison; open: still to be made, unknown: given up."""
MOST_OPEN = 200
SHORTEST_REPORTED = 0.1
"""Shortest restored time, in s, worth reporting. In almost every run the first ticks come from the
vehicle's log, because the station receives the arming late."""


@dataclass(frozen=True, slots=True)
class Completeness:
    """Completeness of one run; times in s of ticks."""

    state: State
    filled: float = 0.0  # from the vehicle's log
    missing: float = 0.0
    total: float = 0.0  # what it would have without gaps
    why: str = ""  # why ticks are missing, or what the run was compared with

    @property
    def line(self) -> str:
        """Return the completeness in words."""
        filled = f"; {self.filled:.1f} s were restored from it" if self.filled else ""
        if self.state == "missing":
            return f"{self.missing:.1f} s missing of {self.total:.1f} s: {self.why}{filled}"
        if self.state == "filled":
            return f"complete: {self.filled:.1f} s of {self.total:.1f} s restored, {self.why}"
        if self.state == "complete":
            return f"complete: {self.why}"
        return self.why or "not compared with the vehicle's log yet"


def store_completeness(catalogue: Catalogue, run_id: str, found: Completeness) -> None:
    """Store the completeness of a run. Raises StorageError."""
    with catalogue.session() as session:
        session.merge(CompletenessRow(run_id=run_id, stamp_ns=time.time_ns(), **asdict(found)))


def completeness_of(catalogue: Catalogue, run_ids: Sequence[str]) -> dict[str, Completeness]:
    """Return run → completeness, without the runs that were never compared."""
    with catalogue.session() as session:
        rows = select(CompletenessRow).where(CompletenessRow.run_id.in_(run_ids))
        return {row.run_id: _completeness(row) for row in session.scalars(rows)}


def open_runs(catalogue: Catalogue, vehicle: str) -> list[str]:
    """Return the ids of the vehicle's runs that are still to be compared, newest first."""
    query = select(RunEntry.id).join(CompletenessRow, CompletenessRow.run_id == RunEntry.id)
    query = query.where(CompletenessRow.state == "open", RunEntry.vehicle == vehicle, NOT_DELETED)
    query = query.order_by(RunEntry.start_ns.desc(), RunEntry.id.desc()).limit(MOST_OPEN)
    with catalogue.session() as session:
        return list(session.scalars(query))


def as_json(found: Completeness | None) -> JsonObject | None:
    return None if found is None else {**asdict(found), "line": found.line}


def _completeness(row: CompletenessRow) -> Completeness:
    return Completeness(row.state, row.filled, row.missing, row.total, row.why)  # type: ignore[arg-type]
