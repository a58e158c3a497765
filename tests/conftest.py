"""Orders the tests, and says which of them may run next to each other (`scripts/test`)."""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
import subprocess
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

from vehicle.simulator.betaflight.process import BUILT

hypothesis.settings.register_profile("quadlab", deadline=None)  # how long one takes is no claim
hypothesis.settings.load_profile("quadlab")

REAL_TIME = ("vehicle/comms/test_process.py::test_a_flight_goes_on_when_comms_is_killed",)
"""Vehicles that fly in real time: the last, and nothing runs beside them."""
LABORATORIES = "system/"
"""Whole laboratories, whose simulated time waits for the machine: one after another in one process,
beside other tests. They share one as long as it runs."""
OWN_LABORATORY = "system/test_betaflight.py"
"""Has one to itself, before the shared one begins: two would starve each other."""
LAST_FLIGHT = "system/test_shutdown.py"
"""Ends the laboratory that the others share."""
LIVE = (
    "vehicle/simulator/test_process.py",
    "console/beacons/test_agreement.py",
    "console/comparison/test_session.py",
    "console/parameters/test_history_of_everybody.py",
    "console/runs/test_marks.py",
)
"""Links that must stay good meanwhile, and a plant that runs in real time."""
BROWSER = "web/browser/"
LONG = ("web/test_openapi.py", "quadlab/test_fly_bearings.py", "vehicle/flight/test_kernels.py")
"""Begun early, so that no process has one of them alone at the end."""
CHROMIUMS = ("chromium-headless-shell", "chromium")
"""Debian's; the shell draws the same with half the work, for it has no window to make."""
HERE = Path(__file__).parent
ROOT = HERE.parent
MOST_TAKEN = 0.05
"""Share of the processor time wanted; where the host took more, a failed flight is not judged."""
BEFORE = pytest.StashKey[tuple[int, int]]()


def pytest_configure(config: pytest.Config) -> None:
    """Make each of several processes a session of its own. Linux shares the processors between
    sessions, and niceness counts within one: a job that leaves the machine to what flies then
    leaves it to the test that waits for it, and not to all other tests."""
    if hasattr(config, "workerinput"):
        os.setsid()
        gc.disable()  # until the tests are collected: all of them stay


@pytest.fixture(scope="session", autouse=True)
def _cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Generator[None]:
    """Keep the columns of the tests' logs out of the user's cache folder, in which only the built
    Betaflight is to be found."""
    cache = tmp_path_factory.mktemp("cache")
    (cache / "quadlab").mkdir()
    (cache / BUILT.relative_to(BUILT.parents[1])).symlink_to(BUILT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Pages first, for they take longest; what flies last."""
    named = (*REAL_TIME, LABORATORIES, OWN_LABORATORY, LAST_FLIGHT, *LIVE, BROWSER, *LONG)
    gone = [name for name in named if not _path(name).exists()]
    if gone:
        raise pytest.UsageError(f"{__file__} names files that do not exist: {', '.join(gone)}")

    def turn(item: pytest.Item) -> tuple[int, int]:
        name = _name(item.nodeid)
        early = name.startswith((LABORATORIES, BROWSER, *LIVE, *LONG))
        is_alone = name.startswith(REAL_TIME)
        place = name.startswith(LAST_FLIGHT) - name.startswith(OWN_LABORATORY)
        return 2 if is_alone else 0 if early else 1, place

    items.sort(key=turn)
    for item in items:
        if _name(item.nodeid).startswith((*REAL_TIME, LABORATORIES, *LIVE, BROWSER)):
            # A machine that stands still for 0.25 s makes the simulated microcontroller land
            # (docs/safety.md), and starves a browser beside two other processes: once more then,
            # and told as a rerun.
            item.add_marker(pytest.mark.flaky(reruns=1))


def pytest_collection_finish() -> None:
    """Thousands of tests stay to the end: no collection of garbage need look at them."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file stays in one process, with what it made once; what flies is one group. (Groups by
    mark, as `--dist loadgroup` has them, are not seen with pytest 9.2 and xdist 3.8.)"""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):  # type: ignore[misc]  # of an untyped package
        def _split_scope(self, nodeid: str) -> str:
            name = _name(nodeid)
            if name.startswith(LABORATORIES):
                return LABORATORIES
            return "real time" if name.startswith(REAL_TIME) else name.split("::", 1)[0]

    return ByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Give what flies in real time the machine to itself, whichever process it is in."""
    run = getattr(item.config, "workerinput", {}).get("testrunuid")
    if run is None:
        return (yield)
    alone = _name(item.nodeid).startswith(REAL_TIME)
    with (Path(tempfile.gettempdir()) / f"quadlab-tests-{run}").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip a real-time flight that failed twice while the host of a virtual machine took the
    processors away, and say how much it took: such a failure says nothing of us."""
    if call.when == "setup":
        item.stash[BEFORE] = processor_time()
    report = yield
    if not (report.failed and _name(item.nodeid).startswith((*REAL_TIME, LABORATORIES))):
        return report
    taken = taken_by_host(item.stash[BEFORE], processor_time())
    if taken > MOST_TAKEN and getattr(item, "execution_count", 1) > 1:
        reason = f"not judged: the host took {taken:.0%} of the processor time wanted here"
        report.outcome, report.longrepr = "skipped", (str(item.path), 1, reason)
        print(f"{item.nodeid} failed, {reason}: {call.excinfo}")
    return report


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print what made a test run again: its second run hides the first's report."""
    for report in terminalreporter.stats.get("rerun", []):
        crash = getattr(report.longrepr, "reprcrash", None)
        reason = crash.message.split("\n")[0] if crash else str(report.longrepr)[:200]
        terminalreporter.write_line(f"run again: {report.nodeid}: {reason}")


def processor_time(stat: Path = Path("/proc/stat")) -> tuple[int, int]:
    """Return ticks since the machine's start: had, and wanted but given to others by its host."""
    user, nice, system, _, _, irq, softirq, steal = map(int, stat.read_text().split()[1:9])
    return user + nice + system + irq + softirq, steal


def taken_by_host(before: tuple[int, int], after: tuple[int, int]) -> float:
    """Share of the time wanted between two readings of `processor_time`."""
    had, taken = (b - a for a, b in zip(before, after, strict=True))
    return taken / max(1, had + taken)


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


@pytest.fixture(scope="session")
def node() -> str:
    """Return Debian's node with the packages of package.json; skip where either is missing."""
    found = shutil.which("node")
    if found is None:
        pytest.skip("node is not installed; it is a Debian package")
    install = subprocess.run(
        [ROOT / "scripts" / "setup_node"], capture_output=True, text=True, check=False
    )
    if install.returncode != 0 and not os.environ.get("CI"):
        pytest.skip(install.stderr.strip())
    assert install.returncode == 0, install.stderr
    return found


def _path(name: str) -> Path:
    """Return the file or folder of a name above."""
    return HERE / name.split("::", 1)[0]


def _name(nodeid: str) -> str:
    """File and test, from this folder on."""
    return nodeid.removeprefix(f"{HERE.name}/")
