"""Child processes: started, watched, restarted, and never left behind.

Every child asks the kernel to end it when this process dies (see `follow_parent`), so that even
`kill -9` of the parent leaves nothing running.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from quadrotor.errors import QuadlabError
from vehicle_link.forked import Process, start
from vehicle_link.jobs import die_with_parent, how_it_ended

PARENT = "QUADLAB_PARENT"
"""Environment variable with the id of the process whose end also ends the child."""
NICENESS = "QUADLAB_NICENESS"
"""Environment variable with the niceness that a child sets for itself, if permitted."""
PATIENCE = 5.0
"""Time, in s, in which a process ends by itself when it is asked to."""
RESTARTS_ALLOWED = 5
RESTART_WINDOW = 30.0
"""Seconds; after more than RESTARTS_ALLOWED deaths within this time the process is given up."""


def follow_parent() -> None:
    """Have SIGTERM end this process when its parent ends, in whatever way; only for a `Child`."""
    parent, niceness = os.environ.pop(PARENT, ""), os.environ.pop(NICENESS, "")
    if parent:
        die_with_parent(int(parent))
    if niceness:
        # Negative niceness needs a right that an ordinary user lacks: then all are equal. Where the
        # kernel groups processes by session, the group's niceness counts.
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, int(niceness))
            Path("/proc/self/autogroup").write_text(niceness)


@dataclass
class Child:
    """One command of this program as a child process.

    Args:
        name: shown to the user.
        words: command line after `python -m quadlab`.
            restart: whether it is started again when it dies by itself.
            niceness: from -20 (served first) to 19 (last); below 0 only where the system allows it.
    """

    name: str
    words: Sequence[str]
    restart: bool = True
    niceness: int = 0
    environment: Mapping[str, str] = field(default_factory=dict)
    _process: Process | None = None
    _died: str = ""
    """The way in which the process died, until it is started again."""
    _is_asked: bool = False
    """True once the process was asked to end."""
    _is_refused: bool = False
    """True if the system refused to start the process at the last try."""
    _deaths: list[float] = field(default_factory=list)

    def start(self) -> None:
        # In a separate session: Ctrl-C in the terminal reaches only the parent, which lands first.
        own = {PARENT: str(os.getpid()), NICENESS: str(self.niceness)}
        environment = {**self.environment, **own}
        self._is_asked = False
        self._process = start("quadlab", self.words, environment=environment, own_session=True)

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process else None

    def watch(self) -> str | None:
        """Restart the child if it died; return a line if there is one to show.

        While the system starts no process (no memory, no file descriptor), each call tries again.

        Raises QuadlabError when the child keeps dying.
        """
        if self._process is not None and self._process.poll() is not None:
            self._note_death(self._process.returncode)
        if not self._died:
            return None
        try:
            self.start()
        except OSError as error:
            was_said, self._is_refused = self._is_refused, True
            line = f"{self.name} {self._died} and cannot be restarted yet: {error.strerror}"
            return None if was_said else f"{line}; trying on"
        line = f"{self.name} {self._died}; started again"
        self._died, self._is_refused = "", False
        return line

    def _note_death(self, status: int) -> None:
        now, self._process = time.monotonic(), None
        self._deaths = [t for t in self._deaths if now - t < RESTART_WINDOW] + [now]
        self._died = how_it_ended(status)
        if not self.restart or len(self._deaths) > RESTARTS_ALLOWED:
            raise QuadlabError(f"{self.name} {self._died} and cannot go on; see its lines above")

    def ask_to_end(self) -> None:
        """Send SIGTERM, once."""
        if self._process is not None and not self._is_asked and self._process.poll() is None:
            self._is_asked = True
            self._process.terminate()

    def stop(self, patience: float = PATIENCE) -> None:
        """Send SIGTERM, then SIGKILL after `patience` seconds."""
        self.ask_to_end()
        process, self._process = self._process, None
        if process is None:
            return
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def stop_all(group: Sequence[Child]) -> None:
    """Stop these processes concurrently, as each may take a while.

    It starts no thread, as there may be no memory for one.
    """
    for child in group:
        child.ask_to_end()
    end = time.monotonic() + PATIENCE
    for child in group:
        child.stop(max(0.0, end - time.monotonic()))
