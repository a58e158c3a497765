"""Every change of every parameter, in the data folder's database: who, when, old, new, flight.

The station writes (`console.parameters.history_writer`), the page reads. Values are stored as
Python literals, which distinguish a text from a number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

from sqlalchemy import BigInteger, Engine, String, Text, UniqueConstraint, func, select
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column

from console.catalogue.transactions import transactions
from flight_log.attached import literal_value
from quadrotor.parameter_description import ParameterValue


class Base(DeclarativeBase):
    """The base class of the tables here."""


class ChangeRow(Base):
    """A change of one parameter's value; `id` is the order."""

    __tablename__ = "parameter_changes"
    __table_args__ = (
        UniqueConstraint("vehicle", "name", "revision", "sent_ns"),
        {"sqlite_autoincrement": True},
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    vehicle: Mapped[str] = mapped_column(String(60), index=True)
    name: Mapped[str] = mapped_column(String(200), index=True)
    old: Mapped[str] = mapped_column(Text)
    new: Mapped[str] = mapped_column(Text)
    requester: Mapped[str] = mapped_column(String(120))
    stamp_ns: Mapped[int] = mapped_column(BigInteger)
    sent_ns: Mapped[int] = mapped_column(BigInteger)
    flight: Mapped[str] = mapped_column(String(120), index=True)
    revision: Mapped[int] = mapped_column(BigInteger)


class FlightRow(Base):
    """A flight from arming to disarming; `after` is the last change before it."""

    __tablename__ = "parameter_flights"

    id: Mapped[int] = mapped_column(primary_key=True)
    vehicle: Mapped[str] = mapped_column(String(60), index=True)
    run: Mapped[str] = mapped_column(String(120))
    start_ns: Mapped[int] = mapped_column(BigInteger)
    end_ns: Mapped[int] = mapped_column(BigInteger, default=0)
    after: Mapped[int] = mapped_column(default=0)


class KnownRow(Base):
    """The value that was received last, by which a missed change is found later."""

    __tablename__ = "parameter_known"

    vehicle: Mapped[str] = mapped_column(String(60), primary_key=True)
    name: Mapped[str] = mapped_column(String(200), primary_key=True)
    value: Mapped[str] = mapped_column(Text)


@dataclass(frozen=True, slots=True)
class RecordedChange:
    """One line of the history; `id` is 0 before it is written."""

    name: str
    old: ParameterValue
    new: ParameterValue
    requester: str
    stamp_ns: int  # computer's clock, at arrival
    sent_ns: int  # clock of the authority that changed it
    flight: str  # run id, "" on the ground
    revision: int  # of the authority that changed it
    id: int = 0


_COLUMNS = tuple(one.name for one in fields(RecordedChange) if one.name != "id")


@dataclass(frozen=True, slots=True)
class Flight:
    """The present or the last flight, and what has changed since it began."""

    run: str
    start_ns: int
    is_over: bool
    values: dict[str, ParameterValue]  # values at arming of the parameters that have changed since


class ParameterHistory:
    """The history of one vehicle, safe to use from several threads and processes. Every method may
    raise StorageError.

    Args:
        engine: of the catalogue's database.
        vehicle: its name; the changes include its station's.
    """

    def __init__(self, engine: Engine, vehicle: str) -> None:
        self._vehicle = vehicle
        self._session = transactions(
            engine, Base.metadata, "the history of parameters", "; the changes act nevertheless"
        )

    # ------------------------------------------------------------------ reading
    def changes(
        self, name: str = "", flight: str | None = None, limit: int = 200, before: int = 0
    ) -> list[RecordedChange]:
        """Return the changes, newest first.

        Args:
            name: of one parameter; "" for all.
            flight: a run id, "" for those on the ground, None for all.
            before: only older ones than this id; 0 for all.
        """
        query = select(ChangeRow).where(ChangeRow.vehicle == self._vehicle)
        if name:
            query = query.where(ChangeRow.name == name)
        if flight is not None:
            query = query.where(ChangeRow.flight == flight)
        if before:
            query = query.where(ChangeRow.id < before)
        with self._session() as session:
            rows = session.scalars(query.order_by(ChangeRow.id.desc()).limit(limit))
            return [_change(row) for row in rows]

    def count(self) -> int:
        with self._session() as session:
            query = select(func.count()).where(ChangeRow.vehicle == self._vehicle)
            return session.scalar(query.select_from(ChangeRow)) or 0

    def flight(self) -> Flight | None:
        """Return the newest flight, or None before the first one."""
        with self._session() as session:
            row = self._last_flight(session)
            if row is None:
                return None
            first = (
                select(func.min(ChangeRow.id))
                .where(ChangeRow.vehicle == self._vehicle, ChangeRow.id > row.after)
                .group_by(ChangeRow.name)
            )
            rows = session.scalars(select(ChangeRow).where(ChangeRow.id.in_(first)))
            values = {change.name: literal_value(change.old) for change in rows}
            return Flight(row.run, row.start_ns, row.end_ns != 0, values)

    def known(self) -> dict[str, ParameterValue]:
        with self._session() as session:
            rows = session.scalars(select(KnownRow).where(KnownRow.vehicle == self._vehicle))
            return {row.name: literal_value(row.value) for row in rows}

    # ------------------------------------------------------------------ writing
    def add(self, changes: Iterable[RecordedChange]) -> None:
        """Add changes in this order; one that already exists is not added again."""
        with self._session() as session:
            for change in changes:
                if self._is_there(session, change):
                    continue
                values = {name: getattr(change, name) for name in _COLUMNS}
                values |= {"old": repr(change.old), "new": repr(change.new)}
                session.add(ChangeRow(vehicle=self._vehicle, **values))
                session.flush()  # ids must follow the order of the changes
                self._know(session, {change.name: change.new})

    def learn(self, values: Mapping[str, ParameterValue]) -> None:
        """Store values that are known without a change."""
        with self._session() as session:
            self._know(session, values)

    def begin_flight(self, run: str, start_ns: int) -> None:
        with self._session() as session:
            newest = session.scalar(select(func.max(ChangeRow.id))) or 0
            session.add(FlightRow(vehicle=self._vehicle, run=run, start_ns=start_ns, after=newest))

    def end_flight(self, end_ns: int) -> None:
        """End the present flight; does nothing when there is none."""
        with self._session() as session:
            row = self._last_flight(session)
            if row is not None and row.end_ns == 0:
                row.end_ns = end_ns

    # ------------------------------------------------------------------ parts
    def _last_flight(self, session: Session) -> FlightRow | None:
        query = select(FlightRow).where(FlightRow.vehicle == self._vehicle)
        return session.scalars(query.order_by(FlightRow.id.desc()).limit(1)).first()

    def _is_there(self, session: Session, change: RecordedChange) -> bool:
        query = select(ChangeRow.id).where(
            ChangeRow.vehicle == self._vehicle,
            ChangeRow.name == change.name,
            ChangeRow.revision == change.revision,
            ChangeRow.sent_ns == change.sent_ns,
        )
        return session.scalar(query) is not None

    def _know(self, session: Session, values: Mapping[str, ParameterValue]) -> None:
        for name, value in values.items():
            session.merge(KnownRow(vehicle=self._vehicle, name=name, value=repr(value)))


def _change(row: ChangeRow) -> RecordedChange:
    values = {name: getattr(row, name) for name in ("id", *_COLUMNS)}
    values |= {"old": literal_value(row.old), "new": literal_value(row.new)}
    return RecordedChange(**values)
