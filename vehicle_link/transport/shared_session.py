"""One session for several users in one process, opened for the first and closed after the last."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any


class SharedSession:
    """Shared session; thread-safe. `open_session` returns a Zenoh session or raises LinkError."""

    def __init__(self, open_session: Callable[[], Any]) -> None:
        self._open_session = open_session
        self._lock = threading.Lock()
        self._session: Any = None
        self._users = 0

    def open(self) -> Any:
        """Open the session or share the open one; release it with `close`. Raises LinkError."""
        with self._lock:
            if self._session is None:
                self._session = self._open_session()
            self._users += 1
            return self._session

    def close(self) -> None:
        """Release the session; after its last user it is closed, which may take long."""
        with self._lock:
            self._users -= 1
            if self._users:
                return
            session, self._session = self._session, None
        session.close()
