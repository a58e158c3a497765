"""Database `<data>/web/access.sqlite` (mode 0600): accounts and open sessions.

It is a separate file and not a part of the catalogue, which is shared with the station, may be on
another server and is passed on with the runs: password hashes belong in none of these.
"""

from __future__ import annotations

import os
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import BigInteger, String, create_engine, event, func, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column, sessionmaker

from quadrotor.errors import StorageError

NAME = "access.sqlite"
READING = "quadlab_reading"


class Base(DeclarativeBase):
    """Base class of these tables."""


class AccountRow(Base):
    """Row of an account.

    `generation` changes with every change of password or role and every sign-out everywhere.
    """

    __tablename__ = "accounts"

    name: Mapped[str] = mapped_column(String(32), primary_key=True)
    role: Mapped[str] = mapped_column(String(16))
    password: Mapped[str] = mapped_column(String(200))  # argon2's encoded form
    generation: Mapped[int] = mapped_column(BigInteger)
    created: Mapped[int] = mapped_column(BigInteger)  # s, epoch
    last_seen: Mapped[int] = mapped_column(BigInteger, default=0)  # s, epoch; 0 = never


class SessionRow(Base):
    """Row of an open session; without it a session is over, even if its cookie is valid."""

    __tablename__ = "sessions"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    label: Mapped[str] = mapped_column(String(64), index=True)
    role: Mapped[str] = mapped_column(String(16))
    generation: Mapped[int] = mapped_column(BigInteger)  # of the account; 0 without one
    issued: Mapped[int] = mapped_column(BigInteger)
    last_seen: Mapped[int] = mapped_column(BigInteger)


class CounterRow(Base):
    """Counter whose numbers are never reused, so that a name added again has no old generation."""

    __tablename__ = "counters"

    name: Mapped[str] = mapped_column(String(32), primary_key=True)
    value: Mapped[int] = mapped_column(BigInteger)


class AccessDatabase:
    """Database of accounts and sessions; safe for several threads and processes.

    Every method may raise StorageError.

    Args:
        folder: `<data>/web`, made if missing.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            # SQLite creates its additional files with the same mode.
            os.close(os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600))
            self._path.chmod(0o600)
        except OSError as error:
            raise StorageError(
                f"cannot write {self._path} ({error.strerror}); "
                "check the data folder's owner, or choose another with --data"
            ) from error
        self._engine = create_engine(f"sqlite:///{self._path}")
        event.listen(self._engine, "connect", _set_up)
        event.listen(self._engine, "begin", _begin)
        self._sessions = sessionmaker(self._engine, expire_on_commit=False)
        with self._said():
            Base.metadata.create_all(self._engine)
            self._watch = sqlite3.connect(
                self._path, timeout=5.0, check_same_thread=False, isolation_level=None
            )
        self._watch_lock = threading.Lock()

    def close(self) -> None:
        self._watch.close()
        self._engine.dispose()

    @contextmanager
    def session(self) -> Iterator[Session]:
        """Yield one transaction, committed at the end; an error raised inside rolls it back."""
        with self._said(), self._sessions.begin() as session:
            yield session

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """Yield a read-only transaction, which never waits for a writer."""
        with self._said(), self._sessions() as session:
            session.connection(execution_options={READING: True})
            yield session

    def version(self) -> int:
        """Return a number that changes after every commit of any process; costs about 2 µs."""
        with self._said(), self._watch_lock:
            row = self._watch.execute("PRAGMA data_version").fetchone()
        return int(row[0])

    @contextmanager
    def _said(self) -> Iterator[None]:
        try:
            yield
        except (SQLAlchemyError, sqlite3.Error) as error:
            reason = str(getattr(error, "orig", None) or error).splitlines()[0]
            raise StorageError(
                f"{self._path} cannot be used ({reason}); if it is damaged, delete it and add "
                "the accounts again with quadlab user add"
            ) from error


def count_accounts(folder: Path) -> int:
    """Return the number of accounts, without creating the file. Raises StorageError."""
    if not (folder / NAME).exists():
        return 0
    database = AccessDatabase(folder)
    try:
        with database.reading() as session:
            return session.scalar(select(func.count()).select_from(AccountRow)) or 0
    finally:
        database.close()


def next_generation(session: Session) -> int:
    """Return a generation that no account has had."""
    row = session.get(CounterRow, "generation")
    if row is None:
        row = CounterRow(name="generation", value=0)
        session.add(row)
    row.value += 1
    return row.value


def _set_up(connection: Any, _record: Any) -> None:
    connection.isolation_level = None  # `_begin` begins the transactions instead
    cursor = connection.cursor()
    cursor.execute("PRAGMA busy_timeout=5000")
    cursor.execute("PRAGMA journal_mode=WAL")  # a check of a session never waits for a writer
    cursor.execute("PRAGMA secure_delete=ON")
    cursor.close()


def _begin(connection: Any) -> None:
    """Begin a transaction whose reads (is this the last admin?) still hold when it writes."""
    reading = connection.get_execution_options().get(READING, False)
    connection.exec_driver_sql("BEGIN" if reading else "BEGIN IMMEDIATE")
