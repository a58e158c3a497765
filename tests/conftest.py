"""Order of the tests, and which of them may run in parallel (`scripts/test`)."""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
import subprocess
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import IO, Any

import hypothesis
import pytest

from vehicle.simulator.betaflight.process import BUILT

hypothesis.settings.register_profile("quadlab", deadline=None)  # the duration is no claim
hypothesis.settings.load_profile("quadlab")

REAL_TIME = ("vehicle/comms/test_process.py::test_a_flight_goes_on_when_comms_is_killed",)
"""Tests of vehicles that fly in real time: they run last, and nothing runs in parallel."""
LABORATORIES = "system/"
"""Tests of whole laboratories, whose simulated time waits for the machine.

They run one after another in one process, in parallel with other tests, and share one laboratory as
long as it runs.
"""
OWN_LABORATORY = "system/test_betaflight.py"
"""Test with a separate laboratory, before the shared one starts: two would starve each other."""
LAST_FLIGHT = "system/test_shutdown.py"
"""Test that ends the laboratory that the others share."""
LIVE = (
    "vehicle/simulator/test_process.py",
    "console/beacons/test_agreement.py",
    "console/comparison/test_session.py",
    "console/parameters/test_history_of_everybody.py",
    "console/runs/test_marks.py",
)
"""Tests of links that must stay good during the test, and of a plant that runs in real time."""
BROWSER = "web/browser/"
LONG = ("quadlab/fly/", "web/test_openapi.py", "vehicle/flight/test_kernels.py")
"""Long tests, which start early, so that no process has one of them alone at the end."""
CHROMIUMS = ("chromium-headless-shell", "chromium")
"""Debian's browsers; the shell draws the same with half the work, as it has no window."""
HERE = Path(__file__).parent
ROOT = HERE.parent
MOST_TAKEN = 0.05
"""Largest share of the processor time taken by the host at which a failed flight is judged."""
BEFORE = pytest.StashKey[tuple[int, int]]()
LOCKS = pytest.StashKey[tuple[IO[str], IO[str]]]()


def pytest_configure(config: pytest.Config) -> None:
    """Make each of several processes a separate session.

    Linux shares the processors between sessions, and niceness counts within one: a low-priority job
    then makes room for the test that waits for it, and not for all other tests.
    """
    if hasattr(config, "workerinput"):
        os.setsid()
        gc.disable()  # until the tests are collected, because all of them stay


@pytest.fixture(scope="session", autouse=True)
def _cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Generator[None]:
    """Keep the columns of the tests' logs out of the user's cache folder.

    Only the compiled Betaflight is used from there.
    """
    cache = tmp_path_factory.mktemp("cache")
    (cache / "quadlab").mkdir()
    (cache / BUILT.relative_to(BUILT.parents[1])).symlink_to(BUILT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the pages' tests first, because they take longest, and those that fly last."""
    own = (OWN_LABORATORY, LAST_FLIGHT)
    named = (*REAL_TIME, LABORATORIES, *own, *LIVE, BROWSER, *LONG)
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
        # A machine that stops for 0.25 s makes the simulated microcontroller land (docs/safety.md),
        # and four processes starve each other: what failed is run again, alone, and told.
        item.add_marker(pytest.mark.flaky(reruns=1))


def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection: thousands of them stay to the end."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep the tests of a file in one process, with its fixtures; all that fly are one group.

    Groups by mark, as of `--dist loadgroup`, do not work with pytest 9.2 and xdist 3.8.
    """
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
    """Share the machine with the other processes, or have it alone for a test in real time."""
    run = getattr(item.config, "workerinput", {}).get("testrunuid")
    if run is None:
        return (yield)
    with _lock_file(run, "turn").open("w") as turn, _lock_file(run, "machine").open("w") as machine:
        item.stash[LOCKS] = turn, machine
        _take_machine(item, alone=_name(item.nodeid).startswith(REAL_TIME))
        return (yield)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Run a test that is run again alone on the machine: it failed beside others."""
    if getattr(item, "execution_count", 1) > 1 and LOCKS in item.stash:
        _take_machine(item, alone=True)


def _lock_file(run: str, name: str) -> Path:
    return Path(tempfile.gettempdir()) / f"quadlab-tests-{run}-{name}"


def _take_machine(item: pytest.Item, alone: bool) -> None:
    """Wait for the machine; who waits to have it alone holds the turn, so that nobody overtakes."""
    turn, machine = item.stash[LOCKS]
    fcntl.flock(machine, fcntl.LOCK_UN)
    fcntl.flock(turn, fcntl.LOCK_EX)
    fcntl.flock(machine, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
    fcntl.flock(turn, fcntl.LOCK_UN)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip a real-time flight that failed twice while the host took the processors away.

    On a virtual machine, such a failure is no evidence of a defect. The message has the share
    taken.
    """
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
    """Print why a test was run again, because the second run hides the first one's report."""
    for report in terminalreporter.stats.get("rerun", []):
        crash = getattr(report.longrepr, "reprcrash", None)
        reason = crash.message.split("\n")[0] if crash else str(report.longrepr)[:200]
        terminalreporter.write_line(f"run again: {report.nodeid}: {reason}")


def processor_time(stat: Path = Path("/proc/stat")) -> tuple[int, int]:
    """Return ticks since the machine's start: used, and wanted but taken by its host."""
    user, nice, system, _, _, irq, softirq, steal = map(int, stat.read_text().split()[1:9])
    return user + nice + system + irq + softirq, steal


def taken_by_host(before: tuple[int, int], after: tuple[int, int]) -> float:
    """Return the share of the wanted time that the host took between two readings."""
    had, taken = (b - a for a, b in zip(before, after, strict=True))
    return taken / max(1, had + taken)


@pytest.fixture(autouse=True)
def priority_given_back() -> Generator[None, None, None]:
    """Restore the priority after a test that raises it.

    Otherwise all tests after it, and their browsers, would starve others.
    """
    before, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    yield
    after = os.sched_getscheduler(0)
    os.sched_setscheduler(0, before, priority)
    assert after == before, "the test left its thread with another scheduling policy"


@pytest.fixture(scope="session")
def chromium_path() -> str:
    """Return the browser for the tests of the page; skip them without one."""
    found = next(filter(None, map(shutil.which, CHROMIUMS)), None)
    if found is None:
        pytest.skip(f"neither {' nor '.join(CHROMIUMS)} is installed; they are Debian packages")
    return found


@pytest.fixture(scope="session")
def node() -> str:
    """Return Debian's node if the packages of package.json are installed; skip otherwise."""
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
    """Return the file or folder of one of the names above."""
    return HERE / name.split("::", 1)[0]


def _name(nodeid: str) -> str:
    """Return file and test, relative to this folder."""
    return nodeid.removeprefix(f"{HERE.name}/")
