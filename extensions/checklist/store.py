"""The checklist of a laboratory, a file in its data folder."""

from __future__ import annotations

import datetime
import json
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, Field, ValidationError

from console.atomic_file import replacing
from quadrotor.errors import RefusedError, StorageError, os_errors

FILE = "checklist.json"
MOST, LONGEST = 40, 120
"""Most items, and most letters of one."""
USUAL = (
    "Nobody in the flight volume, nets closed",
    "Propellers undamaged and tight",
    "Batteries charged",
    "Tracking system sees the vehicle, axes checked by hand",
    "Emergency land and Cut motors known to everybody",
)
"""The items until somebody writes others."""


class Tick(BaseModel):
    """A tick: who did an item, and when, in s since 1970."""

    by: str
    stamp: float


class _Kept(BaseModel):
    """The content of the file; ticks of an earlier day no longer count."""

    items: list[str] = list(USUAL)
    day: datetime.date = datetime.date.min
    ticks: dict[str, Tick] = Field(default_factory=dict)


class Item(NamedTuple):
    """An item with its tick of this day, if it has one."""

    text: str
    tick: Tick | None


class ChecklistStore:
    """The checklist, safe to use from several threads.

    Args:
        folder: the data folder.
        now: returns the local time.
    """

    def __init__(
        self, folder: Path, now: Callable[[], datetime.datetime] = datetime.datetime.now
    ) -> None:
        self._path = folder / FILE
        self._now = now
        self._lock = threading.Lock()

    def items(self) -> list[Item]:
        """Return the items with the ticks of this day. Raises StorageError."""
        with self._lock:
            kept = self._read()
        return [Item(text, kept.ticks.get(text)) for text in kept.items]

    def write(self, items: Sequence[str]) -> None:
        """Replace the items; those that stay keep their ticks. Raises StorageError."""
        wanted = list(dict.fromkeys(" ".join(text.split()) for text in items))
        with self._lock:
            kept = self._read()
            kept.items = [text for text in wanted if text]
            self._write(kept)

    def tick(self, text: str, by: str, *, done: bool) -> None:
        """Tick an item, or take its tick back.

        Raises RefusedError for an item that is not there, and StorageError.
        """
        with self._lock:
            kept = self._read()
            if text not in kept.items:
                raise RefusedError(f"the checklist has no item {text!r:.80}; somebody changed it")
            kept.ticks.pop(text, None)
            if done:
                kept.ticks[text] = Tick(by=by, stamp=self._now().timestamp())
            self._write(kept)

    def _read(self) -> _Kept:
        try:
            text = self._path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return _Kept(day=self._now().date())
        except OSError as error:
            raise StorageError(f"{self._path} cannot be read: {error.strerror}") from error
        try:
            kept = _Kept.model_validate_json(text)
        except (ValidationError, ValueError) as error:
            raise StorageError(
                f"{self._path} is no checklist; mend it, or remove it to begin with the usual items"
            ) from error
        if kept.day != self._now().date():
            kept = _Kept(items=kept.items, day=self._now().date())
        return kept

    def _write(self, kept: _Kept) -> None:
        content = json.dumps(kept.model_dump(mode="json"), indent=1, ensure_ascii=False)
        with (
            os_errors(lambda why: f"{self._path} cannot be written: {why}"),
            replacing(self._path) as new,
        ):
            new.write_text(content, encoding="utf-8")
