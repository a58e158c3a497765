"""Selection and order of the tests of a run (`scripts/test`), and what all of them share."""

from __future__ import annotations

import gc
import json
import math
import os
from collections import Counter, defaultdict
from collections.abc import Generator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

from tests.counterparts import COUNTERPARTS, chromium, left_out_line, problems

# The duration is no claim, and the same examples are tried each time: a gate is not a search.
hypothesis.settings.register_profile("quadlab", deadline=None, derandomize=True)
hypothesis.settings.load_profile("quadlab")

DURATIONS = Path(__file__).with_name("durations.json")
"""Seconds that each file or group of tests takes in one process; `--write-durations` writes it."""
LABORATORIES = "tests/system/"
"""Tests of whole laboratories, one group: they share one, and two at once would starve each other.

Their simulated time waits for the machine, so that they run beside other tests.
"""
LEFT_OUT = pytest.StashKey[Counter[str]]()
FORBIDDEN = pytest.StashKey[dict[str, str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("quadlab")
    group.addoption(
        "--complete",
        action="store_true",
        help="run the tests that need programs beyond Python and the extra `dev`, and only those",
    )
    group.addoption(
        "--with",
        action="append",
        choices=sorted(COUNTERPARTS),
        dest="counterparts",
        help="as --complete, but only the tests that need no other programs than those named",
    )
    group.addoption(
        "--write-durations", action="store_true", help=f"write {DURATIONS.name} from this run"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Refuse a complete run without its counterparts; give each of several processes a session.

    Linux shares the processors between sessions, and niceness counts within one: a low-priority job
    then makes room for the test that waits for it, and not for all other tests.
    """
    if hasattr(config, "workerinput"):
        os.setsid()
        gc.disable()  # until the tests are collected, because all of them stay
        config.stash[FORBIDDEN] = config.workerinput["forbidden"]
        return
    missing, config.stash[FORBIDDEN] = problems(_wanted(config))
    if missing:
        raise pytest.UsageError(*missing)
    if config.option.write_durations:
        config.pluginmanager.register(_Durations())


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out what has no such mark in the run of `-m alone`: to import all takes 8 s."""
    if config.option.markexpr != "alone":
        return None
    below = collection_path.rglob("*.py") if collection_path.is_dir() else [collection_path]
    sources = [one for one in below if one.suffix == ".py"]
    return None if any("mark.alone" in one.read_text() for one in sources) else True


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell a process of pytest-xdist what the kernel forbids."""
    node.workerinput["forbidden"] = node.config.stash[FORBIDDEN]


def _wanted(config: pytest.Config) -> frozenset[str]:
    """Return the counterparts of a complete run, by their words; none for a bare run."""
    named = config.option.counterparts
    return frozenset(named or (COUNTERPARTS if config.option.complete else ()))


@pytest.hookimpl(trylast=True)  # behind the choice by -m and -k
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests of this run; several processes begin with the files that take longest."""
    wanted, forbidden = _wanted(config), config.stash[FORBIDDEN]
    kept, dropped, left_out = [], [], Counter[str]()
    for item in items:
        needs = _needs(item)
        if bool(needs) == bool(wanted) and needs <= wanted:
            kept.append(item)
            for word in needs & forbidden.keys():
                item.add_marker(pytest.mark.skip(reason=forbidden[word]))
        else:
            dropped.append(item)
            left_out.update(needs)
    config.stash[LEFT_OUT] = left_out
    config.hook.pytest_deselected(items=dropped)
    if hasattr(config, "workerinput"):
        took = json.loads(DURATIONS.read_text())
        kept.sort(key=lambda item: -took.get(_group(item.nodeid), math.inf))  # of a new file: long
    items[:] = kept


def _needs(item: pytest.Item) -> frozenset[str]:
    """Return the words of the counterparts that a test needs."""
    words = {word for mark in item.iter_markers("needs") for word in mark.args}
    if unknown := words - COUNTERPARTS.keys():
        known = ", ".join(COUNTERPARTS)
        raise pytest.UsageError(f"{item.nodeid} needs {', '.join(unknown)}; known are {known}")
    fixtures = getattr(item, "fixturenames", ())
    return frozenset(
        word for word, part in COUNTERPARTS.items() if word in words or part.fixture in fixtures
    )


def _group(nodeid: str) -> str:
    """Return the name of the tests that run in the same process as this one, in their order."""
    file = nodeid.partition("::")[0]
    of_laboratory = file.startswith(LABORATORIES) or file.endswith("/test_laboratory.py")
    return LABORATORIES if of_laboratory else file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep each group in one process; groups by mark do not work with pytest 9.2 and xdist 3.8."""
    from xdist.scheduler import LoadScopeScheduling

    class ByGroup(LoadScopeScheduling):  # type: ignore[misc]  # of an untyped package
        def _split_scope(self, nodeid: str) -> str:
            return _group(nodeid)

    return ByGroup(config, log)


def pytest_collection_finish() -> None:
    """Exclude the collected tests from garbage collection: thousands of them stay to the end."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand the number of tests left out to the parent of a process of pytest-xdist."""
    if hasattr(session.config, "workeroutput"):
        left_out = session.config.stash.get(LEFT_OUT, Counter())
        session.config.workeroutput["left out"] = dict(left_out)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take the number of tests left out from a process: each of them collects all tests."""
    if told := getattr(node, "workeroutput", None):
        node.config.stash[LEFT_OUT] = Counter(told["left out"])


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say which tests a bare run has left out, and what installs their counterparts."""
    left_out = config.stash.get(LEFT_OUT, Counter())
    if left_out and not _wanted(config):
        terminalreporter.write_line(left_out_line(left_out))


class _Durations:
    """Adds the durations of the tests of each group, and writes them in the end."""

    def __init__(self) -> None:
        self._seconds: defaultdict[str, float] = defaultdict(float)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._seconds[_group(report.nodeid)] += report.duration

    def pytest_sessionfinish(self) -> None:
        took = {name: round(seconds, 1) for name, seconds in sorted(self._seconds.items())}
        known = json.loads(DURATIONS.read_text())
        known = {name: seconds for name, seconds in known.items() if Path(name).exists()}
        DURATIONS.write_text(json.dumps(dict(sorted({**known, **took}.items())), indent=0) + "\n")


@pytest.fixture(scope="session", autouse=True)
def _cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Generator[None]:
    """Keep the columns of the tests' logs out of the user's cache folder.

    Only the compiled Betaflight is used from there.
    """
    cache = tmp_path_factory.mktemp("cache")
    (cache / "quadlab").mkdir()
    users = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for built in users.glob("quadlab/betaflight-*"):
        (cache / "quadlab" / built.name).symlink_to(built)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        yield


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
    """Return the browser for the tests of the page."""
    found = chromium()
    assert found is not None
    return found


@pytest.fixture(scope="session")
def node_path() -> str:
    """Return the program node; the packages of package.json are installed."""
    return "node"
