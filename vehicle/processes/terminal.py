"""Lines on the terminal, with the name of the vehicle: several may share one."""

from __future__ import annotations

import sys


class _Terminal:
    def __init__(self) -> None:
        self._speaker = "vehicle"

    def speak_for(self, name: str) -> None:
        """Name the vehicle in all lines of this process from now on."""
        self._speaker = f"vehicle {name}"

    def say(self, line: str) -> None:
        """Print one line to the terminal, in one piece: other processes write there, too."""
        sys.stderr.write(f"{self._speaker}: {line}\n")
        sys.stderr.flush()


_terminal = _Terminal()
speak_for, say = _terminal.speak_for, _terminal.say
