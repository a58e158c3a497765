"""Titles of runs say what was flown and changed; what a person wrote stands instead."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.tables import RunEntry
from console.catalogue.titles import LONGEST, Title, store_title, titles_of, write_title
from console.parameters.store import StationStore
from console.runs.runs import RunManager
from console.runs.title import RunTitle
from quadrotor.errors import ParameterError, StorageError
from tests.support.clock import Clock
from tests.waiting import wait_for
from vehicle_link import clock
from vehicle_link.lockstep import Page

RUN = "20260131T093042Z_quad1"


@pytest.fixture
def catalogue(tmp_path: Path) -> Iterator[Catalogue]:
    made = Catalogue(tmp_path / "data")
    made.add(RunEntry(RUN, "quad1", 1, 2.0, RUN))
    yield made
    made.close()


def test_a_title_counts_what_was_flown_and_names_what_was_changed() -> None:
    title = RunTitle()
    title.started("take_off", {})
    title.started("follow_trajectory", {"trajectory": "figure_eight", "laps": 3})
    for _ in range(2):
        title.started("excite", {"axis": "x"})
    title.changed("control.position.kp_xy", 4.0, 8.5)
    title.changed("control.position.kp_xy", 8.5, 13.0)
    title.started("land", {})
    assert title.text() == "Figure 8 × 1, step tests × 2, kp_xy 4 → 13"


@pytest.mark.parametrize(("seconds", "said"), [(45.2, "45 s"), (89.6, "90 s"), (125.0, "2 min")])
def test_a_flight_in_hover_alone_is_named_by_how_long_it_hovered(
    monkeypatch: pytest.MonkeyPatch, seconds: float, said: str
) -> None:
    now = Clock(100.0)
    monkeypatch.setattr("console.runs.title.monotonic", now)
    title = RunTitle()
    now.now += 30.0  # on the ground, motors on
    assert title.text() == ""
    title.started("take_off", {})
    now.now += seconds - 20.0
    title.started("hover", {})
    now.now += 10.0
    title.started("land", {})
    now.now += 40.0
    title.started("take_off", {})
    now.now += 10.0
    assert title.text() == f"Hover {said}", "with no landing it lasts until now"
    title.started("land", {})
    now.now += 40.0
    title.changed("control.position.kp_xy", 4.0, 13.0)
    assert title.text() == f"Hover {said}, kp_xy 4 → 13"
    title.started("excite", {"axis": "x"})
    assert title.text() == "Step test × 1, kp_xy 4 → 13"


def test_a_change_that_was_taken_back_is_not_in_the_title() -> None:
    title = RunTitle()
    title.changed("control.kp", 4.0, 13.6)
    title.changed("control.kp", 13.6, 4.0)
    assert title.text() == ""


def test_what_runs_in_parallel_and_does_not_fly_is_not_in_the_title() -> None:
    title = RunTitle()
    title.started("bearings", {})
    title.changed("estimation.shadow_source", "bearings", "same")
    title.changed("control.shadow_law", "none", "pid_cascade")
    assert title.text() == "Bearings × 1"


def test_a_title_stays_short() -> None:
    title = RunTitle()
    title.changed("control.use_observer", False, True)
    title.changed("station.bearings.layout", "[" * 90, "]" * 90)
    for k in range(4):
        title.changed(f"control.k{k}", 1, 2)
    assert title.text() == (
        "use_observer off → on, station.bearings.layout changed, k0 1 → 2, 3 more changes"
    )


def test_what_a_person_wrote_stands_until_it_is_emptied(catalogue: Catalogue) -> None:
    store_title(catalogue, RUN, "Figure 8 × 1")
    write_title(catalogue, RUN, "  the windy\tone ", "anna")
    store_title(catalogue, RUN, "Figure 8 × 2")
    assert titles_of(catalogue, [RUN, "none"]) == {RUN: Title("the windy one", "anna")}
    assert [run.id for run in catalogue.runs("windy")] == [RUN]
    assert catalogue.runs("figure") == []
    write_title(catalogue, RUN, "", "bob")
    assert titles_of(catalogue, [RUN]) == {RUN: Title("Figure 8 × 2")}
    assert [run.id for run in catalogue.runs("figure")] == [RUN]


@pytest.mark.parametrize(
    ("text", "problem"), [("x" * (LONGEST + 1), "121 char"), ("\x1b[0m", "one line")]
)
def test_a_title_that_is_none_is_refused_in_one_line(
    catalogue: Catalogue, text: str, problem: str
) -> None:
    with pytest.raises(ParameterError, match=problem) as refused:
        write_title(catalogue, RUN, text, "anna")
    assert "\n" not in str(refused.value)
    assert titles_of(catalogue, [RUN]) == {}


def test_a_run_that_is_unknown_gets_no_title(catalogue: Catalogue) -> None:
    with pytest.raises(StorageError, match="no run 'other'"):
        write_title(catalogue, "other", "x", "anna")


def test_a_run_gets_its_title_when_it_ends(catalogue: Catalogue) -> None:
    store = StationStore()
    store.preset({"station.recorder.keep_free": 10.0, "station.recorder.after_disarm": 0.0})
    parameters: Any = SimpleNamespace(snapshot=lambda: ({}, 1, ""), defaults=dict)
    runs = RunManager(catalogue, store, parameters, "quad1", "eva", lambda: b"{}")
    try:
        runs.note_start("excite", {})  # of no run
        runs.note_change("control.kp", 1.0, 2.0)
        first = runs.start("eva")
        runs.note_start("fly_to", {"x": 1.0})
        runs.note_change("control.kp", 2.0, 3.0)
        runs.recorder.stop()
        wait_for(lambda: runs.recorder.wait_idle(0.1))
        second = runs.start("eva")
        runs.note_start("excite", {})
    finally:
        runs.close()
    texts = {run_id: title.text for run_id, title in titles_of(catalogue, [first, second]).items()}
    assert texts == {first: "Fly to × 1, kp 2 → 3", second: "Step test × 1"}


def test_a_run_in_slow_simulated_time_is_listed_by_the_computer_s_clock(
    catalogue: Catalogue, tmp_path: Path
) -> None:
    store = StationStore()
    store.preset({"station.recorder.keep_free": 10.0})
    parameters: Any = SimpleNamespace(snapshot=lambda: ({}, 1, ""), defaults=dict)
    page = Page(["quad1"], tmp_path)
    clock.follow(page.path)
    try:
        words = clock.page()
        assert words is not None
        words[clock.LIMIT] = clock.FREE
        words[clock.OFFSET] -= 480_000_000_000
        runs = RunManager(catalogue, store, parameters, "quad1", "eva", lambda: b"{}")
        run_id = runs.start("eva")
        assert 400.0 < clock.wall_time() - 1e-9 * clock.time_ns() < 560.0
        runs.close()
    finally:
        clock.follow(None)
        page.close()
    assert abs(1e-9 * catalogue.get(run_id).start_ns - clock.wall_time()) < 80.0
