"""The newest events of a vehicle and its station, in the data folder's database.

The station writes what it receives, and the page reads it when it starts: what was said is not lost
with the page's process. All events of a run are in its log.
"""

from __future__ import annotations

import msgspec
from sqlalchemy import BigInteger, Engine, String, Text, delete, func, select
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from console.catalogue.transactions import transactions

KEPT, SPARE = 500, 100
"""Number of events that are kept, and of older ones that may remain until they are removed."""


class Base(DeclarativeBase):
    """The base class of the table here."""


class EventRow(Base):
    """One event; `id` is the order."""

    __tablename__ = "events"

    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    vehicle: Mapped[str] = mapped_column(String(60), index=True)
    stamp_ns: Mapped[int] = mapped_column(BigInteger)
    sent_ns: Mapped[int] = mapped_column(BigInteger)
    level: Mapped[int]
    source: Mapped[str] = mapped_column(String(60))
    kinds: Mapped[str] = mapped_column(String(120))
    text: Mapped[str] = mapped_column(Text)


class KeptEvent(msgspec.Struct, frozen=True):
    """One event.

    Attributes:
        stamp_ns: of its arrival, computer's clock.
        sent_ns: of the event, vehicle's clock.
        level: as in rcl_interfaces/Log.
        source: who says so, as a node's name.
        kinds: names of vehicle_link.commands.EventKind, parted by spaces.
    """

    stamp_ns: int
    sent_ns: int
    level: int
    source: str
    kinds: str
    text: str


class EventBook:
    """The events of one vehicle, safe to use from several threads and processes.

    Args:
        engine: of the catalogue's database.
    """

    def __init__(self, engine: Engine, vehicle: str) -> None:
        self._vehicle, self._added = vehicle, 0
        self._session = transactions(engine, Base.metadata, "the list of events")

    def newest(self) -> list[KeptEvent]:
        """Return the events, oldest first. Raises StorageError."""
        query = select(EventRow).where(EventRow.vehicle == self._vehicle)
        with self._session() as session:
            rows = session.scalars(query.order_by(EventRow.id.desc()).limit(KEPT)).all()
            return [
                KeptEvent(**{name: getattr(row, name) for name in KeptEvent.__struct_fields__})
                for row in reversed(rows)
            ]

    def add(self, event: KeptEvent) -> None:
        """Add an event, and remove old ones from time to time. Raises StorageError."""
        with self._session() as session:
            session.add(EventRow(vehicle=self._vehicle, **msgspec.structs.asdict(event)))
            self._added += 1
            if self._added % SPARE == 0:
                newest = session.scalar(select(func.max(EventRow.id))) or 0
                mine = EventRow.vehicle == self._vehicle
                session.execute(delete(EventRow).where(mine, EventRow.id <= newest - KEPT))
