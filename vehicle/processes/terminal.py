"""Lines on the terminal, with the name of the vehicle, as several may share one terminal."""

from __future__ import annotations

import sys


class _Terminal:
    def __init__(self) -> None:
        self._speaker = "vehicle"

    def speak_for(self, name: str) -> None:
        """Prefix all further lines of this process with the name of the vehicle."""
        self._speaker = f"vehicle {name}"

    def say(self, line: str) -> None:
        """Print one line to the terminal in one write, as other processes also write to it."""
        sys.stderr.write(f"{self._speaker}: {line}\n")
        sys.stderr.flush()


_terminal = _Terminal()
speak_for, say = _terminal.speak_for, _terminal.say
