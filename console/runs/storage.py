"""The disk space that runs use, and the remaining recording time."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select

from console.catalogue.catalogue import Catalogue
from console.catalogue.search import NOT_DELETED
from console.catalogue.tables import RunEntry, TrashRow
from console.runs.disk import free_bytes
from flight_log.columns.places import CACHES, folder_bytes

RECENT = 10
"""Number of newest runs whose mean rate is used while nothing is recorded."""


@dataclass(frozen=True, slots=True)
class Storage:
    """Use of the disk; sizes in bytes."""

    runs: int
    run_bytes: int
    deleted: int
    deleted_bytes: int
    replay_bytes: int  # of the columns
    free: int
    rate: float  # bytes/s, mean of the newest runs; 0 without any

    def lasts(self, keep_free: int, rate: float = 0.0) -> float | None:
        """Return the seconds until only `keep_free` bytes are left, at `rate` or that of the newest
        runs; None when unknown.
        """
        rate = rate or self.rate
        return max(0.0, (self.free - keep_free) / rate) if rate > 0.0 else None


def storage(catalogue: Catalogue) -> Storage:
    """Return the disk space used by runs. Raises StorageError."""
    size = func.coalesce(func.sum(RunEntry.bytes), 0)
    listed = select(func.count(), size).select_from(RunEntry).where(NOT_DELETED)
    deleted = select(func.count(), size).select_from(RunEntry)
    deleted = deleted.where(RunEntry.id.in_(select(TrashRow.run_id)))
    recent = select(RunEntry.bytes, RunEntry.duration).where(NOT_DELETED, RunEntry.duration > 1.0)
    recent = recent.order_by(RunEntry.start_ns.desc()).limit(RECENT)
    with catalogue.session() as session:
        runs, run_bytes = session.execute(listed).one()
        trashed, trashed_bytes = session.execute(deleted).one()
        newest = session.execute(recent).all()
    seconds = sum(row.duration for row in newest)
    return Storage(
        runs=int(runs),
        run_bytes=int(run_bytes),
        deleted=int(trashed),
        deleted_bytes=int(trashed_bytes),
        replay_bytes=folder_bytes(catalogue.folder / CACHES),
        free=free_bytes(catalogue.folder),
        rate=sum(row.bytes for row in newest) / seconds if seconds else 0.0,
    )
