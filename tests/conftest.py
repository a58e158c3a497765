"""Which tests may run beside which, when two processes share them (`scripts/test`)."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

import pytest

REAL_TIME = ("system/", "vehicle/test_comms_process.py", "vehicle/test_simulator_process.py")
"""Whole laboratories and vehicles that fly in real time: one after the other, before the rest."""
BROWSER = "web/browser/"
CHROMIUMS = ("chromium-headless-shell", "chromium")
"""Debian's; the shell draws the same with half the work, for it has no window to make."""
NICENESS = Path("/proc/self/autogroup")
HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A file stays in one process, with what it made once; what flies is one group, the first.

    What runs beside it meanwhile gives way; the browsers, which do not, come last.
    """

    def turn(item: pytest.Item) -> int:
        path = _path(item)
        return 0 if path.startswith(REAL_TIME) else 2 if path.startswith(BROWSER) else 1

    items.sort(key=turn)
    for item in items:
        path = _path(item)
        group = "real time" if path.startswith(REAL_TIME) else path
        item.add_marker(pytest.mark.xdist_group(group))
        if path.startswith(REAL_TIME):
            # A machine that stands still for 0.25 s makes the simulated microcontroller stop its
            # motors (docs/safety.md): that flight is flown once more, and told as a rerun.
            item.add_marker(pytest.mark.flaky(reruns=1))


def pytest_configure() -> None:
    """Each of several processes is a session of its own, which the kernel schedules as a group."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        with contextlib.suppress(PermissionError):  # it is one already
            os.setsid()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """What does not fly gives way to what does, in whichever process that is."""
    if "PYTEST_XDIST_WORKER" in os.environ and NICENESS.exists():
        wanted = "0" if _path(item).startswith(REAL_TIME) else "19"
        with contextlib.suppress(OSError):  # only root may take it back, and may be refused, too
            NICENESS.write_text(wanted)


@pytest.fixture(scope="session")
def chromium_path() -> str:
    """The browser of the tests of the page; skips where there is none."""
    found = next(filter(None, map(shutil.which, CHROMIUMS)), None)
    if found is None:
        pytest.skip(f"neither {' nor '.join(CHROMIUMS)} is installed; they are Debian packages")
    return found


def _path(item: pytest.Item) -> str:
    return item.path.relative_to(HERE).as_posix()
