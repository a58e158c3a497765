"""Open sessions: checked in memory at every request, stored in the database.

The sessions are read again whenever any process has committed to the database: `quadlab user
remove` in a terminal signs out a browser of the running page at its next request.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sqlalchemy import delete, or_, select, update
from sqlalchemy.orm import Session as Transaction

from quadrotor.errors import RefusedError
from web.access.database import AccessDatabase, AccountRow, SessionRow
from web.access.roles import Role, Session
from web.access.steady_time import steady_time

SESSION_AGE = 30 * 24 * 3600  # s
PER_LABEL = 50  # open sessions of one account; the oldest are ended


@dataclass(frozen=True, slots=True)
class Seen:
    """Person with open sessions."""

    label: str
    role: Role
    has_account: bool
    sessions: int
    last_seen: int  # s, epoch


class Sessions:
    """Open sessions; thread-safe. Every method may raise StorageError."""

    def __init__(self, database: AccessDatabase, clock: Callable[[], float] = steady_time) -> None:
        self._database = database
        self._clock = clock
        self._lock = threading.Lock()
        self._version: int | None = None
        self._open: dict[str, Session] = {}
        self._seen: dict[str, int] = {}  # since the last `write_seen`

    def open(self, label: str, role: Role, generation: int = 0) -> Session:
        """Open a session.

        `generation` is that of the account when its password was verified: if it has changed since,
        the session is over before it begins.
        """
        now = int(self._clock())
        session = Session(label, role, secrets.token_urlsafe(16), generation, now)
        with self._database.session() as transaction:
            mine = select(SessionRow.id).where(SessionRow.label == label)
            old = transaction.scalars(mine.order_by(SessionRow.issued.desc()).offset(PER_LABEL - 1))
            transaction.execute(delete(SessionRow).where(SessionRow.id.in_(old.all())))
            transaction.add(
                SessionRow(
                    id=session.id,
                    label=label,
                    role=role.value,
                    generation=generation,
                    issued=now,
                    last_seen=now,
                )
            )
            if generation > 0:
                account = update(AccountRow).where(AccountRow.name == label)
                transaction.execute(account.values(last_seen=now))
        return session

    def is_open(self, session: Session) -> bool:
        """Return whether `holds` is true, and if so note that the session was seen now."""
        if not self.holds(session):
            return False
        self._seen[session.id] = int(self._clock())
        return True

    def holds(self, session: Session) -> bool:
        """Return whether the session is still valid.

        It is not if it was ended, if it is too old, or if its account has changed since. A session
        may be used with a lower role than it was opened with, that of a viewer.
        """
        with self._lock:
            version = self._database.version()
            if version != self._version:
                self._open = self._read()
                self._version = version
            known = self._open.get(session.id)
        is_known = known is not None and session in (known, replace(known, role=Role.VIEWER))
        return is_known and self._clock() < session.issued + SESSION_AGE

    def end(self, session: Session) -> None:
        """Sign one browser out."""
        with self._database.session() as transaction:
            transaction.execute(delete(SessionRow).where(SessionRow.id == session.id))

    def end_guests(self, label: str) -> None:
        """End the sessions by link with this label. Raises RefusedError if there are none."""
        with self._database.session() as transaction:
            guests = SessionRow.label == label, SessionRow.generation == 0
            ended = transaction.scalars(select(SessionRow.id).where(*guests)).all()
            if not ended:
                raise RefusedError(f"no one is signed in as {label!r:.60}")
            transaction.execute(delete(SessionRow).where(*guests))

    def people(self) -> list[Seen]:
        """Return everyone with open sessions, by label."""
        self.write_seen()
        with self._database.reading() as transaction:
            rows = _valid(transaction)
        found: dict[tuple[str, bool], list[SessionRow]] = {}
        for row in rows:
            found.setdefault((row.label, row.generation > 0), []).append(row)
        return [
            Seen(label, Role(own[-1].role), account, len(own), max(r.last_seen for r in own))
            for (label, account), own in sorted(found.items())
        ]

    def write_seen(self) -> None:
        """Store when each session was last seen, and delete sessions that are too old."""
        seen, self._seen = self._seen, {}
        oldest = int(self._clock()) - SESSION_AGE
        with self._database.session() as transaction:
            transaction.execute(delete(SessionRow).where(SessionRow.issued <= oldest))
            for session_id, when in list(seen.items()):
                row = transaction.get(SessionRow, session_id)
                if row is None:
                    continue
                row.last_seen = max(row.last_seen, when)
                if row.generation > 0:
                    transaction.execute(
                        update(AccountRow)
                        .where(AccountRow.name == row.label, AccountRow.last_seen < when)
                        .values(last_seen=when)
                    )

    def _read(self) -> dict[str, Session]:
        with self._database.reading() as transaction:
            rows = _valid(transaction)
        return {
            row.id: Session(row.label, Role(row.role), row.id, row.generation, row.issued)
            for row in rows
        }


def _valid(transaction: Transaction) -> Sequence[SessionRow]:
    """Return the sessions of guests, and those of accounts that have not changed since."""
    of_account = SessionRow.label == AccountRow.name
    same = (SessionRow.generation == AccountRow.generation) & (SessionRow.role == AccountRow.role)
    query = (
        select(SessionRow)
        .outerjoin(AccountRow, of_account & (SessionRow.generation > 0))
        .where(or_(SessionRow.generation == 0, same))
    )
    return transaction.scalars(query).all()
