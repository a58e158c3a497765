"""Preparation of the compiled code of estimators while the comparison continues without them.

A separate process compiles what is not cached yet, at idle priority. In a thread, a compiler would
hold the interpreter of the comparison; and if that thread had low priority, a busy machine could
leave it waiting while it holds the interpreter.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress

from quadrotor.errors import JobError, UsageError
from vehicle_link.jobs import IDLE, run

REPORTED_AFTER = 1.0
MODULES = {
    "complementary": (
        "estimation.complementary_filter",
        "estimation.poses.frame_solution",
        "estimation.poses.position_at_attitude",
    ),
    "error_state": ("estimation.error_state.filter", "estimation.poses.frame_solution"),
}
"""Modules whose cached code shows that an estimator is compiled. An estimator registered elsewhere
is prepared in the process that registered it."""


class CompiledEstimators:
    """Called from one thread; prepares one estimator after the other in another thread.

    Args:
        say: called with a line when compiling takes long, or fails.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._ready: set[str] = set()
        self._requested: set[str] = set()
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()

    def ready(self, name: str) -> bool:
        """Return whether an estimator can be created; if not, start to prepare it unless that was
        done.
        """
        if name in self._ready:
            return True
        busy = self._thread is not None and self._thread.is_alive()
        if not busy and name not in self._requested and not self._closing.is_set():
            self._requested.add(name)
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
            from quadrotor.compiled import is_cached

            if not all(is_cached(module) for module in MODULES.get(name, ())):
                self._compile(name)
            if not self._closing.is_set():
                registry.prepare(name, bearings=True)
                self._ready.add(name)
        except UsageError as error:
            self._say(f"comparing {name}: {error}")
        except Exception as error:  # an unknown estimator may raise anything
            self._say(f"comparing {name}: cannot be prepared: {type(error).__name__}: {error}")

    def _compile(self, name: str) -> None:
        """Compile in a separate process; what it leaves undone is compiled here, later."""
        began, is_reported = time.monotonic(), False

        def check() -> None:
            nonlocal is_reported
            if self._closing.is_set():
                raise JobError("no longer needed")
            if not is_reported and time.monotonic() - began > REPORTED_AFTER:
                is_reported = True
                self._say(f"comparing {name}: compiling")

        with suppress(JobError):
            run(prepare, name, niceness=IDLE, check=check)


def prepare(name: str) -> None:
    """Compile and cache everything of one estimator."""
    from estimation import registry

    registry.prepare(name, bearings=True)
