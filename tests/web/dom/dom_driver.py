"""The node process of pages without a browser: requests and answers, a line of JSON each."""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SCRIPT = Path(__file__).with_name("driver.js")
LATE = 120.0
"""Longest wait for node itself, in s."""


class DomError(AssertionError):
    """Error of a page, or of a test that asks for what only a browser has."""


@dataclass(frozen=True)
class DomRequest:
    """Request or answer that a page's script has made or had."""

    url: str
    method: str
    status: int = 0


@dataclass(frozen=True)
class PageError:
    """Error that no script of a page has caught."""

    text: str
    stack: str

    def __str__(self) -> str:
        return self.text


class DomDriver:
    """One node process, which holds the pages of all tests of a process."""

    def __init__(self, node: str) -> None:
        self._process = subprocess.Popen(
            [node, SCRIPT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._count = 0
        self._pages: dict[int, Callable[[dict[str, Any]], None]] = {}
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def ask(self, on: int | None, call: str, *args: Any) -> Any:
        """Return what node answers. Raises DomError."""
        assert self._process.stdin is not None
        self._count += 1
        request = {"id": self._count, "on": on, "call": call, "args": args}
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        while True:
            answer = self._next()
            if answer.get("id") == self._count:
                break
        if "error" in answer:
            raise DomError(answer["error"])
        return answer["value"]

    def _next(self) -> dict[str, Any]:
        """Return the next line; what happened in a page is passed on to it."""
        try:
            line = self._lines.get(timeout=LATE)
        except queue.Empty:
            raise DomError(f"node did not answer for {LATE:.0f} s") from None
        if not line:
            raise DomError(f"node ended with {self._process.wait(LATE)}; see its words above")
        said: dict[str, Any] = json.loads(line)
        if "event" in said and said["page"] in self._pages:
            self._pages[said["page"]](said)
        return said

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Read lines until the condition holds."""
        while not condition():
            try:
                self._next()
            except DomError as error:
                raise DomError(f"waited for {what} in vain: {error}") from None

    def listen(self, page: int, hear: Callable[[dict[str, Any]], None]) -> None:
        """Pass what happens in a page on to `hear`."""
        self._pages[page] = hear

    def close(self) -> None:
        """End node; it must end well."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        assert self._process.wait(LATE) == 0
