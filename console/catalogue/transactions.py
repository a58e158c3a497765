"""Transactions in the data folder's database, for every module that has tables in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from sqlalchemy import Engine, MetaData
from sqlalchemy.exc import OperationalError, SQLAlchemyError
from sqlalchemy.orm import Session, sessionmaker

from quadrotor.errors import StorageError

Transactions = Callable[[], AbstractContextManager[Session]]


def transactions(engine: Engine, tables: MetaData, what: str, remark: str = "") -> Transactions:
    """Create missing tables, and return a function that begins a transaction.

    Args:
        what: what the tables hold, for error messages.
        remark: the end of each error message.

    Raises StorageError, as every transaction does, when the database fails.
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
        except OperationalError:  # station and page start at the same time: the other has made them
            tables.create_all(engine)
    return session
