"""The tables of the catalogue.

What people write about a run has its own tables, so that a catalogue made by an older version lacks
only tables, which are added, and never columns.
"""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import BigInteger, String, Text
from sqlalchemy.orm import DeclarativeBase, Mapped, MappedAsDataclass, mapped_column

ID = 120
LABEL = 120


class Base(DeclarativeBase):
    """The base class of the tables here."""


class RunEntry(MappedAsDataclass, Base):
    """One run; the log itself is a file in the runs folder."""

    __tablename__ = "runs"

    id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    vehicle: Mapped[str] = mapped_column(String(60), index=True)
    start_ns: Mapped[int] = mapped_column(BigInteger, index=True)  # epoch, of the computer
    duration: Mapped[float]  # s
    file: Mapped[str] = mapped_column(String(200))
    """Name of the run's folder or single file within the runs folder."""
    bytes: Mapped[int] = mapped_column(BigInteger, default=0)
    messages: Mapped[int] = mapped_column(BigInteger, default=0)
    operator: Mapped[str] = mapped_column(String(LABEL), default="")
    complete: Mapped[bool] = mapped_column(default=False)  # closed with its index
    recovered: Mapped[bool] = mapped_column(default=False)
    """True if the end of the run was lost and the file was closed later."""
    problem: Mapped[str] = mapped_column(Text, default="")
    """The defect of the file, empty if there is none."""
    notes: Mapped[str] = mapped_column(Text, default="")

    @property
    def start(self) -> datetime:
        """Return the start in UTC."""
        return datetime.fromtimestamp(self.start_ns * 1e-9, UTC)


class NoteRow(Base):
    """A present or earlier text of a run's notes; the newest is also in `runs`."""

    __tablename__ = "run_notes"

    version: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    run_id: Mapped[str] = mapped_column(String(ID), index=True)
    text: Mapped[str] = mapped_column(Text)
    author: Mapped[str] = mapped_column(String(LABEL))
    stamp_ns: Mapped[int] = mapped_column(BigInteger)


class TagRow(Base):
    """A tag of a run."""

    __tablename__ = "run_tags"

    run_id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    tag: Mapped[str] = mapped_column(String(40), primary_key=True, index=True)


class TitleRow(Base):
    """The title of a run: the station's, and the one that a person wrote instead."""

    __tablename__ = "run_titles"

    run_id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    automatic: Mapped[str] = mapped_column(String(120), default="")
    written: Mapped[str] = mapped_column(String(120), default="")
    author: Mapped[str] = mapped_column(String(LABEL), default="")


class Mark(MappedAsDataclass, Base):
    """A moment that a person marked; the mark's messages are in the log too."""

    __tablename__ = "run_marks"

    run_id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    id: Mapped[str] = mapped_column(String(64), primary_key=True)
    stamp_ns: Mapped[int] = mapped_column(BigInteger)
    """The vehicle's clock when the key was pressed."""
    time: Mapped[float]  # s since the start of the run
    text: Mapped[str] = mapped_column(Text, default="")
    requester: Mapped[str] = mapped_column(String(LABEL), default="")


class TrashRow(Base):
    """A deleted run whose files are in the trash."""

    __tablename__ = "run_trash"

    run_id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    deleted_ns: Mapped[int] = mapped_column(BigInteger)
    requester: Mapped[str] = mapped_column(String(LABEL), default="")


class CompletenessRow(Base):
    """A comparison of a run with the vehicle's own log (console.catalogue.completeness)."""

    __tablename__ = "run_completeness"

    run_id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    state: Mapped[str] = mapped_column(String(20), index=True)
    filled: Mapped[float] = mapped_column(default=0.0)
    missing: Mapped[float] = mapped_column(default=0.0)
    total: Mapped[float] = mapped_column(default=0.0)
    why: Mapped[str] = mapped_column(Text, default="")
    stamp_ns: Mapped[int] = mapped_column(BigInteger)
