"""Named sets of parameter values, stored in the data folder's database with author and time."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import BigInteger, Engine, String, Text, select
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column

from console.catalogue.transactions import transactions
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue


class Base(DeclarativeBase):
    """The base class of the table here."""


class PresetRow(Base):
    """Saved once, never changed; a deleted one can be restored."""

    __tablename__ = "parameter_presets"

    id: Mapped[int] = mapped_column(primary_key=True)
    vehicle: Mapped[str] = mapped_column(String(60), index=True)
    name: Mapped[str] = mapped_column(String(60))
    requester: Mapped[str] = mapped_column(String(120))
    stamp_ns: Mapped[int] = mapped_column(BigInteger)
    content: Mapped[str] = mapped_column(Text)
    deleted: Mapped[bool] = mapped_column(default=False)


@dataclass(frozen=True, slots=True)
class Preset:
    """A saved set."""

    id: int
    name: str
    requester: str
    stamp_ns: int  # epoch
    values: dict[str, ParameterValue]


class ParameterPresets:
    """The presets of one vehicle, safe to use from several threads and processes. Every method may
    raise StorageError.

    Args:
        engine: of the catalogue's database.
        vehicle: its name.
    """

    def __init__(self, engine: Engine, vehicle: str) -> None:
        self._vehicle = vehicle
        self._session = transactions(engine, Base.metadata, "the presets")

    def all(self) -> list[Preset]:
        """Return all presets, ordered by name."""
        with self._session() as session:
            query = select(PresetRow).where(
                PresetRow.vehicle == self._vehicle, PresetRow.deleted.is_(False)
            )
            return [_preset(row) for row in session.scalars(query.order_by(PresetRow.name))]

    def get(self, preset_id: int) -> Preset:
        """Return a preset. Raises RefusedError when it does not exist."""
        with self._session() as session:
            return _preset(self._row(session, preset_id, deleted=False))

    def save(
        self,
        name: str,
        values: Mapping[str, ParameterValue],
        requester: str,
        *,
        replaces: bool = False,
    ) -> Preset:
        """Save a preset. Raises RefusedError when the name is taken and `replaces` is False."""
        with self._session() as session:
            taken = self._named(session, name)
            if taken is not None and not replaces:
                raise RefusedError(
                    f"there is a preset {name!r} of {taken.requester}; replace it, or choose "
                    "another name"
                )
            if taken is not None:
                taken.deleted = True
            row = PresetRow(
                vehicle=self._vehicle,
                name=name,
                requester=requester,
                stamp_ns=time.time_ns(),
                content=json.dumps(dict(values)),
            )
            session.add(row)
            session.flush()
            return _preset(row)

    def delete(self, preset_id: int) -> None:
        """Delete a preset. Raises RefusedError when it does not exist."""
        with self._session() as session:
            self._row(session, preset_id, deleted=False).deleted = True

    def restore(self, preset_id: int) -> Preset:
        """Restore a deleted preset. Raises RefusedError when its name is in use again."""
        with self._session() as session:
            row = self._row(session, preset_id, deleted=True)
            if self._named(session, row.name) is not None:
                raise RefusedError(f"there is another preset {row.name!r} now; delete that first")
            row.deleted = False
            return _preset(row)

    def _named(self, session: Session, name: str) -> PresetRow | None:
        query = select(PresetRow).where(
            PresetRow.vehicle == self._vehicle, PresetRow.name == name, PresetRow.deleted.is_(False)
        )
        return session.scalars(query).first()

    def _row(self, session: Session, preset_id: int, *, deleted: bool) -> PresetRow:
        row = session.get(PresetRow, preset_id)
        if row is None or row.vehicle != self._vehicle or row.deleted is not deleted:
            what = "deleted preset" if deleted else "preset"
            raise RefusedError(f"there is no {what} {preset_id}; the Gains tab lists all")
        return row


def _preset(row: PresetRow) -> Preset:
    return Preset(row.id, row.name, row.requester, row.stamp_ns, json.loads(row.content))
