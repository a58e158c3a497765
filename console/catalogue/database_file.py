"""A watch over the database's file: whether it is still the one that was opened.

SQLite goes on writing into a file that was removed or replaced, without an error, and everything it
writes there is lost with the process. Each transaction therefore begins by checking the file.
"""

from __future__ import annotations

import os
from pathlib import Path

from sqlalchemy import Engine, event

from quadrotor.errors import StorageError

Identity = tuple[int, int]
"""Device and inode."""


class DatabaseFile:
    """Checks the file before every transaction of an engine; StorageError ends the transaction.

    Args:
        engine: of SQLite, with its file created; an engine without a file is never checked.
        data: the data folder, for messages.
    """

    def __init__(self, engine: Engine, data: Path) -> None:
        self._data = data
        name = engine.url.database if engine.dialect.name == "sqlite" else None
        self._path = Path(name) if name and name != ":memory:" else None
        self._opened = self._identity()
        if self._path is not None:
            # Before a new connection too: it would create an empty file.
            event.listen(engine, "do_connect", self._look)
            event.listen(engine, "checkout", self._look)

    def problem(self) -> str:
        """Return why nothing can be saved and what to do; "" when it can. Never waits for the
        database.
        """
        # Asked first: a file that disappears between the two checks is missing, not read-only.
        writable = self._path is None or os.access(self._path, os.W_OK)
        if gone := self._gone():
            return gone
        if writable:
            return ""
        return (
            f"{self._path} is not writable for this user; only recordings are saved; "
            "correct its permissions or its owner"
        )

    def _gone(self) -> str:
        """Return the problem of a missing or replaced file, as `problem` does."""
        if self._path is None or self._identity() == self._opened:
            return ""
        remedy = "mount its disk or restore it, or restart quadlab to continue with what is there"
        if not self._data.is_dir():
            return f"the data folder is gone: {self._data}; nothing is recorded or saved; {remedy}"
        if not self._path.exists():
            found = f"{self._path.name} is gone from the data folder {self._path.parent}"
        else:
            found = f"{self._path} is not the file that was opened"
        return f"{found}; only recordings are saved; {remedy}"

    def _identity(self) -> Identity | None:
        if self._path is None:
            return None
        try:
            found = os.stat(self._path)
        except OSError:
            return None
        return found.st_dev, found.st_ino

    def _look(self, *_: object) -> None:
        if gone := self._gone():
            raise StorageError(gone)
