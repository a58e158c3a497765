"""The display and questions of a guided procedure on a terminal; plain lines elsewhere."""

from __future__ import annotations

import select
import sys
from collections.abc import Callable
from typing import Any

from vehicle_link.messages.records import ExperimentStatus

SHOWN = 8
"""Largest number of live figures shown."""
HIDDEN = ("pose ", "next ")
"""Prefixes of live figures that are points of a drawing."""
BAR = 30


class Screen:
    """The screen of one command. On a terminal the newest state is in its last lines."""

    def __init__(self) -> None:
        self.is_terminal = sys.stdin.isatty() and sys.stdout.isatty()
        self._live: Any = None
        self._instruction = ""

    def say(self, line: str) -> None:
        self.rest()
        print(line, flush=True)

    def progress(self, status: ExperimentStatus) -> None:
        """Show the ExperimentStatus of a running experiment."""
        instruction = str(status.instruction or status.step)
        count = int(status.step_count)
        if count:
            instruction = f"[{status.step_number}/{count}] {instruction}"
        if not self.is_terminal:
            if instruction not in ("", self._instruction):
                print(instruction, flush=True)
            self._instruction = instruction
            return
        done = round(BAR * min(max(float(status.step_share), 0.0), 1.0))
        lines = [instruction, f"{'━' * done}{'─' * (BAR - done)} {status.elapsed:5.0f} s"]
        live = zip(status.live_names, status.live_values, status.live_units, strict=True)
        figures = [one for one in live if not str(one[0]).startswith(HIDDEN)][:SHOWN]
        lines += [f"  {name}: {value:.4g} {unit}" for name, value, unit in figures]
        self._show("\n".join(lines))

    def rest(self) -> None:
        """End the live display, so that further output appears below it."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def ask(self, prompt: str, is_open: Callable[[], bool]) -> str | None:
        """Return a typed line without surrounding blanks; None when `is_open` becomes false, or at
        the end of the input.
        """
        self.rest()
        print(prompt, end=" ", flush=True)
        while is_open():
            ready, _, _ = select.select([sys.stdin], [], [], 0.1)
            if ready:
                line = sys.stdin.readline()
                return line.strip().lower() if line else None
        print(flush=True)
        return None

    def _show(self, text: str) -> None:
        from rich.live import Live
        from rich.text import Text

        if self._live is None:
            self._live = Live(auto_refresh=False, transient=True)
            self._live.start()
        self._live.update(Text(text), refresh=True)
