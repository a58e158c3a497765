"""Event marks through a real station: in the log at the time of the key press, and catalogued."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.marks import marks_of
from console.runs.adoption import marks_in_log, tidy_runs
from tests.waiting import wait_for
from vehicle_link.messages import decode, stamp_of
from vehicle_link.topics.table import TOPICS

AHEAD_NS = 40_000_000_000
SECOND = 1_000_000_000
COUNT = iter(range(10_000))


@pytest.fixture(autouse=True)
def vehicle_clock(linked: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Set the vehicle's clock 40 s ahead of the station's."""
    clock: Callable[[], int] = lambda: time.time_ns() + AHEAD_NS  # noqa: E731
    monkeypatch.setattr(linked.station.link, "vehicle_ns", clock)


@pytest.fixture
def run(linked: Any) -> Iterator[str]:
    yield linked.station.runs.start("ada")
    stop(linked)


def stop(linked: Any) -> None:
    linked.station.runs.recorder.stop()
    assert linked.station.runs.recorder.wait_idle(20.0)


def mark(linked: Any, ago: float = 0.0, **fields: Any) -> tuple[str, Any]:
    pressed_ns = time.time_ns() - round(ago * SECOND)
    sent = {"id": f"mark-{next(COUNT):04}", "text": "", "pressed_ns": pressed_ns, **fields}
    return sent["id"], linked.call("mark", **sent)


def test_a_mark_stands_in_log_and_catalogue_at_the_time_of_the_key_press(
    linked: Any, run: str
) -> None:
    wait_for(lambda: linked.station.runs.recorder.status().duration > 0.4)
    before = time.time_ns() + AHEAD_NS
    name, answer = mark(linked, ago=0.3, text="gust")
    after = time.time_ns() + AHEAD_NS
    assert answer.accepted, answer.reason
    assert (answer.run_id, answer.logged) == (run, True)
    stop(linked)
    [found] = marks_in_log(linked.catalogue.resolve(run), run)
    assert found == marks_of(linked.catalogue, run)[0]
    assert (found.id, found.text, found.requester) == (name, "gust", "ada")
    assert before - 3 * SECOND // 10 <= found.stamp_ns <= after - 3 * SECOND // 10
    assert found.time == answer.time


def test_a_text_that_follows_belongs_to_the_first_mark(linked: Any, run: str) -> None:
    told: list[Any] = []
    kind = TOPICS["marks"].type_name
    linked.page.subscribe(
        "marks", kind, lambda r: told.append(decode(r.payload, kind)), qos=TOPICS["marks"].qos
    )
    name, first = mark(linked)
    _, second = mark(linked, id=name, text="  lost   bearings ", pressed_ns=0)
    assert second.accepted, second.reason
    assert second.time == first.time
    stop(linked)
    [found] = marks_in_log(linked.catalogue.resolve(run), run)
    assert (found.text, found.time) == ("lost bearings", first.time)
    assert marks_of(linked.catalogue, run) == [found]
    wait_for(lambda: len(told) == 2)
    assert [(one.id, one.text) for one in told] == [(name, ""), (name, "lost bearings")]
    assert stamp_of(told[0]) == stamp_of(told[1])


def test_without_a_recording_a_mark_is_refused_with_the_reason(linked: Any) -> None:
    _, answer = mark(linked)
    assert not answer.accepted
    assert "nothing is being recorded" in answer.reason


def test_a_text_after_the_end_goes_to_the_catalogue_and_not_into_the_next_run(
    linked: Any, run: str
) -> None:
    name, _ = mark(linked)
    stop(linked)
    size = linked.catalogue.resolve(run).stat().st_size
    next_run = linked.station.runs.start("ada")
    _, answer = mark(linked, id=name, text="a gust", pressed_ns=0)
    stop(linked)
    assert (answer.accepted, answer.logged, answer.run_id) == (True, False, run)
    assert [one.text for one in marks_of(linked.catalogue, run)] == ["a gust"]
    assert linked.catalogue.resolve(run).stat().st_size == size
    assert marks_in_log(linked.catalogue.resolve(next_run), next_run) == []


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"id": "short"}, "is not an id; allowed are 8 to 64"),
        ({"id": "no/slash/in/it"}, "is not an id"),
        ({"text": "x" * 501}, "501 characters; allowed are 500"),
        ({"pressed_ns": 1}, "allowed are 10 s at most"),
        ({"pressed_ns": 0}, "no mark has the id"),
    ],
)
def test_what_makes_no_sense_is_refused(
    linked: Any, run: str, fields: dict[str, Any], reason: str
) -> None:
    _, answer = mark(linked, **fields)
    assert not answer.accepted
    assert reason in answer.reason
    stop(linked)
    assert marks_of(linked.catalogue, run) == []


def test_a_lost_catalogue_learns_the_marks_from_the_logs(
    linked: Any, run: str, tmp_path: Path
) -> None:
    mark(linked, text="door")
    stop(linked)
    fresh = Catalogue(tmp_path)
    shutil.copytree(linked.catalogue.resolve(run), fresh.folder / run)
    tidy_runs(fresh)
    assert [one.text for one in marks_of(fresh, run)] == ["door"]
