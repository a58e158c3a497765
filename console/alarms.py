"""The alarms of the station, each reported once as an event when it begins."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence


class Alarms:
    """Alarms by cause, one line each however often the cause is noticed; thread-safe.

    Args:
        on_begin: called with each new line, outside the lock.
    """

    def __init__(self, on_begin: Callable[[str], None]) -> None:
        self._on_begin = on_begin
        self._lock = threading.Lock()
        self._lines: dict[str, str] = {}
        self._foreign: set[str] = set()

    def set(self, key: str, line: str | None) -> None:
        """Raise or change the alarm of this cause; None clears it."""
        with self._lock:
            is_known = line in self._lines.values() or line in self._foreign
            begins = key not in self._lines and not is_known
            if line is None:
                self._lines.pop(key, None)
            else:
                self._lines[key] = line
        if begins and line is not None:
            self._on_begin(line)

    def keyed(self) -> dict[str, str]:
        """Return the alarms by cause."""
        with self._lock:
            return dict(self._lines)

    def lines(self, foreign: Sequence[str] = ()) -> list[str]:
        """Return all alarms, including `foreign` ones that another object keeps (the recorder),
        each line once.
        """
        with self._lock:
            own = list(dict.fromkeys(self._lines.values()))
            foreign = [line for line in dict.fromkeys(foreign) if line not in own]
            begun = [line for line in foreign if line not in self._foreign]
            self._foreign = set(foreign)
        for line in begun:
            self._on_begin(line)
        return [*own, *foreign]
