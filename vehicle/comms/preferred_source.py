"""Choose one of several sources of the same data: the first one is used until it falls silent."""

from __future__ import annotations

from typing import Generic, TypeVar

Key = TypeVar("Key")
SILENT_NS = 1_000_000_000


class FirstHeard(Generic[Key]):
    """Selector of the first source received; times in ns of any steady clock. Not thread-safe."""

    def __init__(self, silent_ns: int = SILENT_NS) -> None:
        self._silent_ns = silent_ns
        self._key: Key | None = None
        self._heard_ns = 0

    def heard(self, key: Key, now_ns: int) -> bool:
        """Return whether to accept this source; it is selected when there is no other."""
        if self.current(now_ns) not in (None, key):
            return False
        self._key, self._heard_ns = key, now_ns
        return True

    def current(self, now_ns: int) -> Key | None:
        """Return the selected source; None when it has been silent for too long."""
        return self._key if now_ns - self._heard_ns < self._silent_ns else None
