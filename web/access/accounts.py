"""Accounts of a data folder: people with a name and a password."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session as Transaction

from quadrotor.errors import RefusedError, UsageError
from web.access.database import AccessDatabase, AccountRow, SessionRow, next_generation
from web.access.passwords import Passwords, check_password
from web.access.roles import Role

NAME = re.compile(r"[a-z][a-z0-9_.-]{0,31}")


@dataclass(frozen=True, slots=True)
class Account:
    """An account, without its password."""

    name: str
    role: Role
    generation: int
    created: int  # s, epoch
    last_seen: int  # s, epoch; 0 = never


def check_name(name: str) -> None:
    """Check the name of an account. Raises UsageError."""
    if not NAME.fullmatch(name):
        raise UsageError(
            f"{name!r:.60} is not a valid user name; use up to 32 lower-case letters, digits and "
            "_ . -, beginning with a letter, such as anna"
        )


class Accounts:
    """Accounts of a data folder; safe for several threads and processes.

    Every method may raise StorageError. Every change, except a new account, ends the sessions of
    the account: their rows are deleted, and the account gets a new generation, which old cookies
    lack.
    """

    def __init__(
        self,
        database: AccessDatabase,
        passwords: Passwords | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._database = database
        self._passwords = passwords or Passwords()
        self._clock = clock

    def all(self) -> list[Account]:
        with self._database.reading() as session:
            rows = session.scalars(select(AccountRow).order_by(AccountRow.name))
            return [_account(row) for row in rows]

    def count(self) -> int:
        with self._database.reading() as session:
            return session.scalar(select(func.count()).select_from(AccountRow)) or 0

    def check_new(self, name: str, role: Role | None = None) -> Role:
        """Return the role a new account would get.

        That is `role`; without one, admin for the first account and operator for the others.

        Raises UsageError for a name that is not allowed; RefusedError if the name is taken, or if
        the first account would not be an admin.
        """
        check_name(name)
        with self._database.reading() as session:
            return _role_of_new(session, name, role)

    def add(self, name: str, role: Role | None, password: str) -> Account:
        """Add an account. Raises as `check_new` and `web.access.passwords.check_password` do."""
        self.check_new(name, role)
        check_password(name, password)
        encoded = self._passwords.hash(password)
        with self._database.session() as session:
            row = AccountRow(
                name=name,
                role=_role_of_new(session, name, role).value,
                password=encoded,
                generation=next_generation(session),
                created=int(self._clock()),
                last_seen=0,
            )
            session.add(row)
            return _account(row)

    def existing(self, name: str) -> Account:
        """Return an existing account.

        Raises RefusedError, which lists the accounts, if it is missing.
        """
        with self._database.reading() as session:
            return _account(_existing(session, name))

    def remove(self, name: str) -> None:
        """Remove an account. Raises RefusedError for the last admin of several accounts."""
        with self._database.session() as session:
            row = _existing(session, name)
            _keep_an_admin(session, row, "removed")
            session.delete(row)
            _end_sessions(session, name)

    def set_role(self, name: str, role: Role) -> None:
        """Set the role of an account. Raises RefusedError for the last admin."""
        with self._database.session() as session:
            row = _existing(session, name)
            if row.role == role.value:
                return
            if role is not Role.ADMIN:
                _keep_an_admin(session, row, f"made {role.value}", even_alone=True)
            row.role = role.value
            _renew(session, row)

    def set_password(self, name: str, password: str) -> Account:
        self.existing(name)
        check_password(name, password)
        encoded = self._passwords.hash(password)
        with self._database.session() as session:
            row = _existing(session, name)
            row.password = encoded
            _renew(session, row)
            return _account(row)

    def end_sessions(self, name: str) -> None:
        """Sign the account out everywhere."""
        with self._database.session() as session:
            _renew(session, _existing(session, name))

    def verify(self, name: str, password: str) -> Account | None:
        """Return the account if the password is right, else None.

        The call takes the same time for an unknown name.
        """
        known = NAME.fullmatch(name) is not None
        with self._database.reading() as session:
            row = session.get(AccountRow, name) if known else None
        if not self._passwords.matches(row.password if row else None, password) or row is None:
            return None
        if self._passwords.is_outdated(row.password):
            self._rehash(row, password)
        return _account(row)

    def _rehash(self, row: AccountRow, password: str) -> None:
        """Hash the same password with the present costs, and leave the generation as it is."""
        encoded = self._passwords.hash(password)
        with self._database.session() as session:
            session.execute(
                update(AccountRow)
                .where(AccountRow.name == row.name, AccountRow.password == row.password)
                .values(password=encoded)
            )


def _role_of_new(session: Transaction, name: str, role: Role | None) -> Role:
    if session.get(AccountRow, name) is not None:
        raise RefusedError(
            f"{name} has an account already; change it with quadlab user role or password"
        )
    is_first = session.scalar(select(func.count()).select_from(AccountRow)) == 0
    if is_first and role not in (None, Role.ADMIN):
        raise RefusedError(f"the first account must be an admin; add {name} with --role admin")
    return role or (Role.ADMIN if is_first else Role.OPERATOR)


def _existing(session: Transaction, name: str) -> AccountRow:
    row = session.get(AccountRow, name)
    if row is None:
        names = session.scalars(select(AccountRow.name).order_by(AccountRow.name).limit(20)).all()
        there = f"there are {', '.join(names)}" if names else "there are no accounts yet"
        raise RefusedError(f"no user {name!r:.60}; {there}")
    return row


def _keep_an_admin(
    session: Transaction, row: AccountRow, what: str, *, even_alone: bool = False
) -> None:
    if row.role != Role.ADMIN.value:
        return
    others = select(AccountRow).where(AccountRow.name != row.name)
    if session.scalars(others.where(AccountRow.role == Role.ADMIN.value)).first() is not None:
        return
    if even_alone or session.scalars(others).first() is not None:
        raise RefusedError(
            f"{row.name} is the last admin and cannot be {what}; make another user admin first"
        )


def _renew(session: Transaction, row: AccountRow) -> None:
    row.generation = next_generation(session)
    _end_sessions(session, row.name)


def _end_sessions(session: Transaction, name: str) -> None:
    session.execute(delete(SessionRow).where(SessionRow.label == name, SessionRow.generation > 0))


def _account(row: AccountRow) -> Account:
    return Account(row.name, Role(row.role), row.generation, row.created, row.last_seen)
