"""Replays are prepared once, and again when the log has changed; in total they stay small."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.runs.adoption import tidy_runs
from console.runs.trash import delete_run, restore_run
from extensions.replay import store as store_module
from extensions.replay.build import INDEX, VERSION
from extensions.replay.reader import Replay
from extensions.replay.store import Building, ReplayStore
from flight_log.columns import places
from flight_log.columns.places import CACHES, place_of
from flight_log.file import LogFile
from quadrotor.errors import LogFormatError, RefusedError, StorageError

Until = Callable[..., None]
RUN = "20260131T093042Z_quad1"
SHORT = MadeRun(7.0)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_run(tmp_path_factory.mktemp("made") / "a.mcap", SHORT).read_bytes()


@pytest.fixture
def log(tmp_path: Path, recorded: bytes) -> Path:
    path = tmp_path / "runs" / f"{RUN}.mcap"
    (path.parent / CACHES).mkdir(parents=True)
    path.write_bytes(recorded)
    return path


@pytest.fixture
def built_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Build replays in this process, for tests of when one is built and not of where."""

    def build(
        function: Callable[..., None], log: Path, *, niceness: int, report: Callable[[float], None]
    ) -> None:
        function(log, report)

    monkeypatch.setattr(store_module, "run", build)


def ready(store: ReplayStore, log: Path, until: Until, newer: bool = False) -> Replay:
    found: list[Any] = [store.get(log, newer=newer)]

    def is_there() -> bool:
        found[0] = store.get(log)
        return isinstance(found[0], Replay)

    if isinstance(found[0], Building):
        until(is_there, 60.0)
    replay = found[0]
    assert isinstance(replay, Replay)
    return replay


def test_a_cache_is_built_once_and_found_by_another_process(log: Path, until: Until) -> None:
    store = ReplayStore()
    with pytest.raises(StorageError, match="not ready"):
        store.opened(log)
    first = ready(store, log, until)
    assert ready(store, log, until) is first
    assert store.opened(log) is first
    again = ReplayStore().get(log)
    assert isinstance(again, Replay)
    assert again.described() == first.described()


@pytest.mark.usefixtures("built_here")
def test_a_log_that_has_changed_is_read_again(log: Path, until: Until) -> None:
    store = ReplayStore()
    before = ready(store, log, until)
    log.unlink()
    write_run(log, MadeRun(8.0))
    assert not store.is_current(log)
    assert isinstance(store.get(log), Building)
    after = ready(store, log, until)
    durations = [one.index["duration"] for one in (before, after)]
    assert durations == pytest.approx([7.0, 8.0], abs=0.03)


@pytest.mark.usefixtures("built_here")
def test_a_run_being_recorded_is_shown_and_what_comes_since_on_demand(
    tmp_path: Path, recorded: bytes, until: Until
) -> None:
    path = tmp_path / "runs" / f"{RUN}.mcap"
    file = LogFile(path)
    file.write(recorded[: len(recorded) // 2])
    store = ReplayStore()
    before = ready(store, path, until)
    file.write(recorded[len(recorded) // 2 : -5000])
    assert store.get(path) is before
    assert not store.is_current(path)
    after = ready(store, path, until, newer=True)
    assert before.index["duration"] < 5.0 < after.index["duration"]
    assert store.is_current(path)
    file.close()


@pytest.mark.parametrize(("content", "why"), [(b"", "is empty"), (b"no log", "not an MCAP log")])
def test_what_is_no_log_says_so_in_one_line_and_leaves_nothing(
    tmp_path: Path, until: Until, content: bytes, why: str
) -> None:
    log = tmp_path / f"{RUN}.mcap"
    (tmp_path / CACHES).mkdir()
    log.write_bytes(content)
    store, told = ReplayStore(), []

    def is_refused() -> bool:
        try:
            store.get(log)
        except LogFormatError as error:
            told.append(str(error))
        return bool(told)

    until(is_refused, 60.0)
    assert why in told[0]
    assert "\n" not in told[0]
    assert list((tmp_path / CACHES).iterdir()) == []


@pytest.mark.usefixtures("built_here")
@pytest.mark.parametrize("harm", ["gone", "cut", "older", "of another state"])
def test_a_damaged_replay_is_built_again(log: Path, until: Until, harm: str) -> None:
    described = ready(ReplayStore(), log, until).described()
    index = place_of(log) / INDEX
    text = index.read_text()
    changed = {
        "gone": None,
        "cut": text[: len(text) // 2],
        "older": text.replace(f'"version":{VERSION}', f'"version":{VERSION - 1}'),
        "of another state": text.replace('"identity":[', '"identity":[1'),
    }[harm]
    if changed is None:
        index.unlink()
    else:
        assert changed != text
        index.write_text(changed)
    store = ReplayStore()
    assert isinstance(store.get(log), Building)
    assert ready(store, log, until).described() == described


def test_a_replay_larger_than_all_may_be_is_given_up_with_the_reason(
    log: Path, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(places, "LARGEST", 1_000)
    store, told = ReplayStore(), []

    def is_refused() -> bool:
        try:
            store.get(log)
        except LogFormatError as error:
            told.append(str(error))
        return bool(told)

    until(is_refused, 60.0)
    assert told[0].startswith(f"the replay of {RUN} would take more than")
    assert list((log.parent / CACHES).iterdir()) == []


@pytest.mark.usefixtures("built_here")
def test_a_run_and_a_log_of_the_vehicle_with_its_name_are_shown_each(
    log: Path, until: Until
) -> None:
    onboard = log.parent.parent / "onboard" / log.name
    onboard.parent.mkdir()
    write_run(onboard, MadeRun(8.0))
    store = ReplayStore()
    first, second = ready(store, log, until), ready(store, onboard, until)
    durations = [one.index["duration"] for one in (first, second)]
    assert durations == pytest.approx([7.0, 8.0], abs=0.03)
    assert store.opened(log) is first
    assert store.opened(onboard) is second


@pytest.mark.usefixtures("built_here")
def test_a_deleted_runs_replay_goes_and_is_built_again_after_an_undo(
    log: Path, until: Until
) -> None:
    catalogue = Catalogue(log.parent.parent)
    tidy_runs(catalogue)
    store = ReplayStore()
    ready(store, log, until)
    delete_run(catalogue, RUN, "anna")
    assert list((log.parent / CACHES).iterdir()) == []
    restore_run(catalogue, RUN)
    store = ReplayStore()
    assert isinstance(store.get(log), Building)
    assert len(ready(store, log, until).track) > 0


def test_replays_that_wait_are_bounded(
    log: Path, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "WAITING", 1)
    other = log.with_name("other.mcap")
    other.write_bytes(log.read_bytes())
    store = ReplayStore()
    store.get(log)
    with pytest.raises(RefusedError, match="1 replays are queued"):
        store.get(other)
    ready(store, log, until)
    ready(store, other, until)
