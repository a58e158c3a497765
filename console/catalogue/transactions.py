"""Transactions in the data folder's database, for whoever has tables in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from sqlalchemy import Engine, MetaData
from sqlalchemy.exc import OperationalError, SQLAlchemyError
from sqlalchemy.orm import Session, sessionmaker

from quadrotor.errors import StorageError

Transactions = Callable[[], AbstractContextManager[Session]]


def transactions(engine: Engine, tables: MetaData, what: str, remark: str = "") -> Transactions:
    """Make the tables that are missing, and return what begins a transaction.

    Args:
        what: is kept in them, for errors. remark: the end of each error.

    Raises StorageError, as every transaction, for what the database cannot do.
    """
    sessions = sessionmaker(engine, expire_on_commit=False)

    @contextmanager
    def guarded() -> Iterator[None]:
        try:
            yield
        except SQLAlchemyError as error:
            reason = str(getattr(error, "orig", None) or error).splitlines()[0]
            raise StorageError(f"{what} cannot be used ({reason}){remark}") from error

    @contextmanager
    def session() -> Iterator[Session]:
        with guarded(), sessions.begin() as one:
            yield one

    with guarded():
        try:
            tables.create_all(engine)
        except OperationalError:  # station and page start at once: another process has made them
            tables.create_all(engine)
    return session
