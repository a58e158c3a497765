"""Which tests may run beside which, when two processes share them (`scripts/test`)."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

hypothesis.settings.register_profile("quadlab", deadline=None)  # how long one takes is no claim
hypothesis.settings.load_profile("quadlab")

REAL_TIME = (
    "system/", "vehicle/test_comms_process.py::test_a_flight_goes_on_when_comms_is_killed",
    "console/test_experiment_evaluation.py",
    "console/test_transfers.py::test_runs_are_filled_by_a_real_process",
)  # fmt: skip
"""Whole laboratories, which take the machine by their priority, vehicles that fly in real time, and
processes that leave it to others by theirs: the last, and nothing runs beside them."""
LIVE = (
    "vehicle/test_simulator_process.py", "console/test_beacon_agreement.py",
    "console/test_comparison_session.py", "console/test_parameter_history_of_everybody.py",
    "console/test_run_marks.py",
)  # fmt: skip
"""Links that must stay good meanwhile, and a plant that runs in real time."""
BROWSER = "web/browser/"
CHROMIUMS = ("chromium-headless-shell", "chromium")
"""Debian's; the shell draws the same with half the work, for it has no window to make."""
HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Pages first, for they take longest; what flies last."""

    def turn(item: pytest.Item) -> int:
        name = _name(item.nodeid)
        return 2 if name.startswith(REAL_TIME) else 0 if name.startswith((BROWSER, *LIVE)) else 1

    items.sort(key=turn)
    for item in items:
        if _name(item.nodeid).startswith((*REAL_TIME, *LIVE, BROWSER)):
            # A machine that stands still for 0.25 s makes the simulated microcontroller land
            # (docs/safety.md), and starves a browser beside two other processes: once more then,
            # and told as a rerun.
            item.add_marker(pytest.mark.flaky(reruns=1))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file stays in one process, with what it made once; what flies is one group. (Groups by
    mark, as `--dist loadgroup` has them, are not seen with pytest 9.2 and xdist 3.8.)"""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            name = _name(nodeid)
            return "real time" if name.startswith(REAL_TIME) else name.split("::", 1)[0]

    return ByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """What flies has the machine to itself, whichever of several processes it is in."""
    run = getattr(item.config, "workerinput", {}).get("testrunuid")
    if run is None:
        return (yield)
    alone = _name(item.nodeid).startswith(REAL_TIME)
    with (Path(tempfile.gettempdir()) / f"quadlab-tests-{run}").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        return (yield)


@pytest.fixture(autouse=True)
def priority_given_back() -> Generator[None, None, None]:
    """A test that makes its process hurry makes all after it, and their browsers, starve others."""
    before, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    yield
    after = os.sched_getscheduler(0)
    os.sched_setscheduler(0, before, priority)
    assert after == before, "the test left its thread with another scheduling policy"


@pytest.fixture(scope="session")
def chromium_path() -> str:
    """The browser of the tests of the page; skips where there is none."""
    found = next(filter(None, map(shutil.which, CHROMIUMS)), None)
    if found is None:
        pytest.skip(f"neither {' nor '.join(CHROMIUMS)} is installed; they are Debian packages")
    return found


def _name(nodeid: str) -> str:
    """File and test, from this folder on."""
    return nodeid.removeprefix(f"{HERE.name}/")
