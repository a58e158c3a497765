"""Compiled code of estimators, while the comparison goes on without them.

A process of its own compiles what is not kept yet, on time no one else wants. In a thread, a
compiler would hold the interpreter of the comparison; and were that thread of low priority, a busy
machine could leave it waiting with the interpreter in its hands.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress

from quadrotor.errors import JobError
from vehicle_link.jobs import IDLE, run

SAID_AFTER = 1.0
KEPT = {
    "complementary": (
        "estimation.complementary_filter",
        "estimation.poses.frame_solution",
        "estimation.poses.position_at_attitude",
    ),
    "error_state": ("estimation.error_state.filter", "estimation.poses.frame_solution"),
}
"""Modules whose kept code tells that an estimator is compiled. One that is registered from
elsewhere is prepared in the process that knows it."""


class Kernels:
    """Asked from one thread; prepares in another, one estimator after the other.

    Args:
        say: takes a line when compiling takes long, or fails.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._ready: set[str] = set()
        self._asked: set[str] = set()
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()

    def ready(self, name: str) -> bool:
        """Return whether an estimator can be made; if not, and no one has asked yet, ask for it."""
        if name in self._ready:
            return True
        busy = self._thread is not None and self._thread.is_alive()
        if not busy and name not in self._asked and not self._closing.is_set():
            self._asked.add(name)
            self._thread = threading.Thread(
                target=self._prepare, args=(name,), name="kernels", daemon=True
            )
            self._thread.start()
        return False

    def close(self) -> None:
        self._closing.set()
        if self._thread is not None:
            self._thread.join(5.0)

    def _prepare(self, name: str) -> None:
        try:
            from estimation import registry
            from quadrotor.compiled import kept

            if not all(kept(module) for module in KEPT.get(name, ())):
                self._compile(name)
            if not self._closing.is_set():
                registry.prepare(name, bearings=True)
                self._ready.add(name)
        except Exception as error:  # of an estimator of unknown make, too
            self._say(f"comparing {name}: cannot be prepared: {type(error).__name__}: {error}")

    def _compile(self, name: str) -> None:
        """Compile in a process of its own; what it leaves undone is compiled here, later."""
        began, said = time.monotonic(), False

        def check() -> None:
            nonlocal said
            if self._closing.is_set():
                raise JobError("no longer needed")
            if not said and time.monotonic() - began > SAID_AFTER:
                said = True
                self._say(f"comparing {name}: compiling")

        with suppress(JobError):
            run(prepare, name, niceness=IDLE, check=check)


def prepare(name: str) -> None:
    """Compile and keep everything of one estimator."""
    from estimation import registry

    registry.prepare(name, bearings=True)
