"""Page of runs in Chromium: find, choose, label, delete and restore, by mouse and keyboard."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from sqlalchemy import delete

from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import Completeness, store_completeness
from console.catalogue.marks import store_mark
from console.catalogue.notes import notes_history, write_notes
from console.catalogue.tables import Mark, RunEntry
from console.catalogue.tags import change_tags, tags_of
from console.runs.trash import deleted_runs
from vehicle_link.messages import header, new

MANY = 450
FIRST, SECOND, THIRD = (f"run{number:04}" for number in range(3))
HOUR_NS = 3_600_000_000_000


def enter(catalogue: Catalogue, count: int) -> None:
    """Add runs, the newest first: run0000, run0001, …, an hour apart; three have files."""
    for name in (FIRST, SECOND, THIRD):
        (catalogue.folder / f"{name}.mcap").write_bytes(bytes(1000))
    with catalogue.session() as session:
        session.add_all(
            RunEntry(
                id=f"run{number:04}",
                vehicle="quad1",
                duration=61.0 + number,
                bytes=1000,
                start_ns=1_769_851_842_000_000_000 - HOUR_NS * number,
                messages=7,
                file=f"run{number:04}.mcap",
                operator="anna" if number % 2 else "grace",
                complete=number != 1,
                recovered=number == 2,
                problem="",
                notes="",
            )
            for number in range(count)
        )


@pytest.fixture
def runs(tmp_path: Path) -> Iterator[Catalogue]:
    """Yield the catalogue with its runs."""
    catalogue = Catalogue(tmp_path)
    enter(catalogue, MANY)
    yield catalogue
    catalogue.close()


@pytest.fixture
def lab(tmp_path: Path, runs: Catalogue, serve: Any) -> Iterator[Any]:
    with serve(tmp_path, runs) as running:
        yield running


@pytest.fixture
def open_runs(context: Any, lab: Any) -> Iterator[Any]:
    """Yield `open_runs()`, which signs a browser in and opens the page; script errors fail."""
    problems: list[str] = []
    contexts: list[Any] = []

    def open_at(role: str = "admin") -> Any:
        made = context
        if context.cookies():  # another person
            made = context.browser.new_context(viewport={"width": 1440, "height": 900})
            made.set_default_timeout(20_000)
            contexts.append(made)
        with lab.sign_in() as admin:
            client = admin if role == "admin" else lab.invited(admin, role)
            cookies = [{"name": n, "value": v, "url": lab.base} for n, v in client.cookies.items()]
        made.add_cookies(cookies)
        page = made.new_page()
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(f"{lab.base}/runs")
        page.wait_for_selector("#list tr[data-index]")
        return page

    yield open_at
    for made in contexts:
        made.close()
    assert problems == []


@pytest.fixture
def runs_page(open_runs: Any) -> Any:
    return open_runs()


@pytest.fixture
def sees(runs_page: Any, look_at: Any) -> Any:
    return look_at(runs_page)


def listed(page: Any) -> list[str]:
    """Return the ids of the rows that are drawn."""
    ids: list[str] = page.eval_on_selector_all(
        "#list tr[data-index] td.start", "cells => cells.map((cell) => cell.title.split(',')[0])"
    )
    return ids


def test_of_many_runs_only_those_in_sight_are_drawn_and_all_can_be_reached(
    runs_page: Any, sees: Any, until: Any
) -> None:
    sees.text("#count", f"^{MANY} runs$")
    assert listed(runs_page)[0] == FIRST
    assert runs_page.locator("#list tr[data-index]").count() < 60
    runs_page.focus("#list table")
    runs_page.keyboard.press("End")
    last = f"run{MANY - 1:04}"
    until(lambda: (runs_page.wait_for_timeout(20), last in listed(runs_page))[1])
    assert runs_page.locator("#list tr[data-index]").count() < 60
    sees.text("#detail .facts", f"^{last}")
    runs_page.keyboard.press("Home")
    sees.text("#detail .facts", f"^{FIRST}")


def test_states_are_words_and_a_report_shows_its_verdict(
    lab: Any, open_runs: Any, look_at: Any
) -> None:
    folder = lab.data / "runs" / f"{FIRST}_report"
    folder.mkdir()
    result = {"experiment": "bearings", "verdict": "failed"}
    (folder / "result.json").write_text(json.dumps(result))
    page = open_runs()
    sees = look_at(page)
    for row, words in enumerate(("closed", "not closed", "recovered")):
        sees.text(f"#run-{row} .state", f"^{words}$")
    sees.text("#run-0 .verdict .chip", "^failed$")
    sees.text("#run-0 .title", "^Bearings$")
    sees.text("#detail .links a >> nth=1", "^Report$")


def test_the_search_finds_words_tags_and_dates(runs: Catalogue, runs_page: Any, sees: Any) -> None:
    change_tags(runs, [SECOND, THIRD], ["wind"], [])
    runs_page.reload()
    runs_page.wait_for_selector("#tag option[value='wind']", state="attached")
    runs_page.keyboard.press("/")
    runs_page.keyboard.type("ANNA run000")
    sees.text("#count", "^5 runs$")
    runs_page.fill("#search", "")
    runs_page.select_option("#tag", "wind")
    sees.text("#count", "^2 runs$")
    runs_page.select_option("#tag", "")
    day = runs_page.inner_text("#run-0 .start")[:10]
    runs_page.fill("#search", day)
    hours = runs_page.evaluate("new Date(1769851842000).getHours()")
    sees.text("#count", f"^{hours + 1} runs$")
    runs_page.fill("#search", "nothing is like this")
    sees.text("#count", "^0 runs$")
    sees.text("#list .empty", "No runs match")


def test_a_list_whose_answer_is_not_there_yet_is_not_called_empty(
    runs_page: Any, sees: Any
) -> None:
    asked: list[Any] = []
    runs_page.route("**/api/runs/search**", lambda route: asked.append(route))
    runs_page.reload()
    sees.text("#list .empty", "^Reading the list of runs")
    assert runs_page.is_hidden("#detail h3 >> nth=0")
    assert asked
    runs_page.unroute("**/api/runs/search**")  # goes on with what waits
    sees.text("#list tbody", r"\d{4}-\d\d-\d\d")


def test_a_list_without_any_run_says_how_the_first_is_made(
    runs: Catalogue, runs_page: Any, sees: Any
) -> None:
    with runs.session() as session:
        session.execute(delete(RunEntry))
    runs_page.reload()
    sees.text("#list .empty", "^No runs yet. Recording starts on arming.$")
    runs_page.fill("#search", "wind")
    sees.text("#list .empty", "^No runs match.$")


def test_deleting_can_be_undone_at_once_and_from_the_trash(
    runs: Catalogue, runs_page: Any, sees: Any, until: Any
) -> None:
    runs_page.focus("#list table")
    for key in ("Space", "Shift+ArrowDown", "Delete"):
        runs_page.keyboard.press(key)
    sees.text("#notice", "Deleted 2 runs; kept in the trash for 7 days")
    assert {run.id for run in deleted_runs(runs)} == {FIRST, SECOND}
    sees.text("#count", f"^{MANY - 2} runs$")
    runs_page.click("#notice button:has-text('Undo')")
    sees.text("#count", f"^{MANY} runs$")
    assert deleted_runs(runs) == []
    runs_page.click("#run-2 .start")
    runs_page.click("#detail button:has-text('Delete')")
    sees.text("#open-trash", r"^Trash \(1\)$")
    runs_page.click("#open-trash")
    sees.text("#trash tbody tr", f"^{THIRD}.*in 6 days")
    runs_page.click(f"#trash button[aria-label='restore {THIRD}']")
    sees.text("#open-trash", "^Trash$")
    until(lambda: deleted_runs(runs) == [])
    assert runs.resolve(THIRD).exists()


def test_an_answer_under_way_does_not_take_the_cursor_back(
    runs: Catalogue, runs_page: Any, sees: Any, lab: Any, until: Any
) -> None:
    held: list[Any] = []
    runs_page.route("**/api/runs/search*", lambda route: held.append(route))
    lab.station._hub.publish_from_thread({"type": "runs"})
    until(lambda: (runs_page.wait_for_timeout(20), held)[1])
    runs_page.click("#run-2 .start")
    with runs_page.expect_response("**/api/runs/search*"):
        runs_page.unroute("**/api/runs/search*")  # releases those that were delayed
    runs_page.evaluate("() => new Promise(requestAnimationFrame)")
    runs_page.click("#detail button:has-text('Delete')")
    sees.text("#notice", f"Deleted {THIRD};")
    until(lambda: [run.id for run in deleted_runs(runs)] == [THIRD])


def test_the_trash_is_emptied_by_a_hold_and_not_by_a_click(
    runs: Catalogue, runs_page: Any, sees: Any, until: Any
) -> None:
    runs_page.click("#detail button:has-text('Delete')")
    runs_page.click("#open-trash")
    button = "#trash button:has-text('Empty trash')"
    runs_page.click(button)
    runs_page.wait_for_timeout(200)
    assert len(deleted_runs(runs)) == 1
    runs_page.hover(button)
    runs_page.mouse.down()
    until(lambda: (runs_page.wait_for_timeout(20), deleted_runs(runs) == [])[1])
    runs_page.mouse.up()
    sees.text("#notice", f"Removed for good: {FIRST}")
    assert not list(runs.folder.rglob(f"{FIRST}*"))


def test_notes_save_themselves_and_tell_when_two_wrote(
    runs: Catalogue, runs_page: Any, sees: Any
) -> None:
    runs_page.click("#run-0 .notes")
    runs_page.keyboard.type("gusty near the door")
    runs_page.keyboard.press("Tab")
    sees.text("#detail .notes .said", "^Saved by admin")
    sees.text("#run-0 .notes", "^gusty near the door$")
    write_notes(runs, FIRST, "calm", "anna")  # the page is not notified
    runs_page.fill("#detail textarea", "gusty, new propellers")
    runs_page.keyboard.press("Tab")
    sees.text("#detail .notes .said", "It replaced what anna wrote at .*“calm”")
    assert runs.get(FIRST).notes == "gusty, new propellers"
    runs_page.click("#detail .said button:has-text('Restore that')")
    sees.value("#detail textarea", "calm")
    sees.text("#run-0 .notes", "^calm$")
    assert len(notes_history(runs, FIRST)) == 4


def test_what_one_writes_appears_at_the_other_and_never_replaces_what_that_one_types(
    runs: Catalogue, open_runs: Any, look_at: Any
) -> None:
    anna, grace = open_runs(), open_runs("operator")
    grace.click("#run-0 .start")
    anna.click("#run-0 .notes")
    anna.keyboard.type("from anna")
    anna.keyboard.press("Tab")
    look_at(grace).value("#detail textarea", "from anna")
    look_at(grace).text("#detail .notes .said", "^Written by admin")
    grace.click("#detail textarea")
    grace.evaluate("""() => { window.setTimeout = () => 0; // it is not saved by itself
      const box = document.querySelector('#detail textarea');
      box.value = 'typing'; box.dispatchEvent(new Event('input')); }""")
    anna.fill("#detail textarea", "from anna again")
    anna.keyboard.press("Tab")
    look_at(grace).text("#detail .notes .said", "admin 1 changed these notes meanwhile")
    look_at(grace).value("#detail textarea", "typing")
    grace.click("#detail .said button:has-text('Take theirs')")
    look_at(grace).value("#detail textarea", "from anna again")
    assert runs.get(FIRST).notes == "from anna again"


def test_a_draft_goes_to_its_own_run_though_another_is_chosen_while_it_is_saved(
    runs: Catalogue, runs_page: Any, until: Any
) -> None:
    held: list[Any] = []
    runs_page.route(f"**/runs/{FIRST}/notes", lambda route: held.append(route), times=1)
    runs_page.click("#run-0 .notes")
    runs_page.fill("#detail textarea", "one")
    runs_page.keyboard.press("Escape")
    until(lambda: (runs_page.wait_for_timeout(20), len(held) == 1)[1])
    runs_page.fill("#detail textarea", "one and more")  # while "one" is being sent
    runs_page.click("#run-1 .notes")
    runs_page.fill("#detail textarea", "two")
    runs_page.keyboard.press("Escape")
    until(lambda: (runs_page.wait_for_timeout(20), runs.get(SECOND).notes == "two")[1])
    held[0].continue_()
    until(lambda: (runs_page.wait_for_timeout(20), runs.get(FIRST).notes == "one and more")[1])
    assert runs.get(SECOND).notes == "two"
    assert runs_page.input_value("#detail textarea") == "two"


def test_a_draft_that_could_not_be_saved_is_kept_with_its_run_and_saved_on_the_way_back(
    runs: Catalogue, runs_page: Any, sees: Any, until: Any
) -> None:
    held: list[Any] = []
    runs_page.route(f"**/runs/{FIRST}/notes", lambda route: held.append(route), times=1)
    runs_page.click("#run-0 .notes")
    runs_page.fill("#detail textarea", "gust")
    runs_page.click("#run-1 .start")
    sees.value("#detail textarea", "")
    until(lambda: (runs_page.wait_for_timeout(20), len(held) == 1)[1])
    held[0].abort()
    sees.text("#notice", f"^Notes of {FIRST} not saved: .*The text is kept with that run")
    runs_page.click("#run-0 .start")
    sees.value("#detail textarea", "gust")
    until(lambda: (runs_page.wait_for_timeout(20), runs.get(FIRST).notes == "gust")[1])


def test_tags_are_added_suggested_and_removed_for_all_that_are_chosen(
    runs: Catalogue, runs_page: Any, sees: Any, until: Any
) -> None:
    change_tags(runs, ["run0100"], ["Wind"], [])
    runs_page.reload()
    runs_page.wait_for_selector("#known-tags option[value='Wind']", state="attached")
    runs_page.click("#run-0 .mark input")
    runs_page.click("#run-2 .mark input")
    sees.text("#detail h2", "^2 runs selected$")
    runs_page.fill("#detail .tag-row input", "wind")
    runs_page.keyboard.press("Enter")
    sees.text("#run-2 .tags", "^Wind$")
    assert tags_of(runs, [FIRST, SECOND, THIRD]) == {FIRST: ["Wind"], THIRD: ["Wind"]}
    runs_page.click("#detail button[aria-label='remove the tag Wind']")
    until(lambda: (runs_page.wait_for_timeout(20), tags_of(runs, [FIRST, THIRD]) == {})[1])


def test_two_runs_can_be_laid_over_each_other_and_enter_replays_one(
    runs_page: Any, sees: Any
) -> None:
    runs_page.route("**/replay/**", lambda route: route.fulfill(status=200, body="replay"))
    runs_page.click("#run-0 .mark input")
    runs_page.click("#run-2 .mark input")
    link = runs_page.locator("#detail a:has-text('Overlay in replay')")
    assert link.get_attribute("href") == f"/replay/{THIRD}?with={FIRST}"
    runs_page.focus("#list table")
    runs_page.keyboard.press("Escape")
    runs_page.keyboard.press("Enter")
    runs_page.wait_for_url(f"**/replay/{THIRD}")


def test_marks_lead_into_the_replay(runs: Catalogue, runs_page: Any, sees: Any) -> None:
    store_mark(runs, Mark(THIRD, "mark-0001", 5, 12.345, "gust from the door", "anna"))
    runs_page.click("#run-2 .start")
    sees.value("#detail .marks input", "gust from the door")
    link = runs_page.locator("#detail .marks a")
    assert link.get_attribute("href") == f"/replay/{THIRD}?at=12.35"


def test_a_viewer_reads_and_downloads_and_changes_nothing(
    runs: Catalogue, open_runs: Any, look_at: Any
) -> None:
    page = open_runs("viewer")
    page.wait_for_selector("#detail a:has-text('Download')")
    assert page.is_disabled("#detail button:has-text('Delete')")
    assert page.is_disabled("#detail .tag-row input")
    assert page.get_attribute("#detail textarea", "readonly") is not None
    page.focus("#list table")
    page.keyboard.press("Delete")
    with page.expect_download() as download:
        page.click("#detail a:has-text('Download')")
    assert download.value.suggested_filename == f"{FIRST}.mcap"
    assert deleted_runs(runs) == []


def test_a_link_for_a_viewer_says_how_long_it_works_and_what_browsers_refuse(
    runs_page: Any, sees: Any, context: Any
) -> None:
    runs_page.context.route(
        "https://app.foxglove.dev/**", lambda route: route.fulfill(status=200, body="foxglove")
    )
    with runs_page.context.expect_page() as opened:
        runs_page.click("#detail button:has-text('Foxglove')")
    assert parse_qs(urlsplit(opened.value.url).query)["ds"] == ["remote-file"]
    sees.text("#detail .said >> nth=0", "for ten minutes, for anyone who has it.*Safari refuses")


def test_a_report_is_made_on_request_and_one_that_cannot_be_says_why(
    runs_page: Any, sees: Any
) -> None:
    runs_page.click("#detail button:text-is('Make report')")
    sees.text("#detail .made", f"^No report: .*{FIRST}.mcap")
    assert runs_page.is_enabled("#detail button:text-is('Make report')")


LOGS = ("quad1_20260131T093042_120Z.mcap", "quad1_20260131T090211_480Z.mcap")


def transfer(kind: str, name: str, phase: str, came: int, problem: str = "") -> Any:
    return new(
        "quadlab_msgs/Transfer",
        kind=kind,
        name=name,
        phase=phase,
        bytes=came,
        problem=problem,
        total_bytes=24_000_000,
        rate=310_000.0,
    )


@pytest.fixture
def under_way(lab: Any) -> Iterator[Any]:
    """Yield `under_way(transfers…)`, which the station publishes from now on, twice a second."""
    told: list[Any] = []
    going = threading.Event()

    def tell() -> None:
        while not going.wait(0.1):
            if told:
                message = new("quadlab_msgs/Transfers", header=header(1), transfers=list(told))
                lab.station.put("transfers", message)

    thread = threading.Thread(target=tell)
    thread.start()
    yield lambda *transfers: told.__setitem__(slice(None), transfers)
    going.set()
    thread.join()


def test_a_run_shows_what_it_lacks_and_how_far_filling_it_is(
    lab: Any, runs: Catalogue, open_runs: Any, look_at: Any, under_way: Any, until: Any
) -> None:
    log = "the vehicle's log"
    for name, found in (
        (FIRST, Completeness("missing", 0.0, 3.2, 61.0, f"{log} of it was overwritten")),
        (SECOND, Completeness("filled", 3.2, 0.0, 62.0, f"31000 ticks, compared with {log}")),
        (THIRD, Completeness("complete", 0.0, 0.0, 63.0, f"31500 ticks, compared with {log}")),
    ):
        runs.update(name, complete=True, recovered=False)
        store_completeness(runs, name, found)
    page = open_runs()
    sees = look_at(page)
    restored = r"complete \(3.2 s restored\)"
    for row, words in enumerate(("3.2 s missing", restored, "complete", "closed")):
        sees.text(f"#run-{row} .state", f"^{words}$")
    sees.text("#detail .fill .ticks", "^3.2 s missing of 61.0 s: .* was overwritten.$")
    page.click("#detail .fill button >> text=Check against onboard log")
    until(lambda: lab.station.requests and lab.station.requests[-1][0] == "transfer")
    assert (lab.station.requests[-1][1].action, lab.station.requests[-1][1].name) == (
        "backfill",
        FIRST,
    )
    under_way(transfer("backfill", FIRST, "fetching", 6_000_000))
    sees.text("#detail .fetching span", r"^Fetching 6.0 MB of 24 MB, 310 kB/s$")
    assert page.locator("#detail .fetching progress").get_attribute("value") == "0.25"
    page.click("#detail .fill button >> text=Cancel")
    until(lambda: lab.station.requests[-1][1].action == "cancel")


def test_logs_on_board_are_fetched_from_the_page(
    lab: Any, open_runs: Any, look_at: Any, under_way: Any, until: Any
) -> None:
    start = 1_769_851_842_000_000_000
    lab.station.answers["onboard_files"] = {
        "free_bytes": 12_400_000_000,
        "files": [
            new(
                "quadlab_msgs/OnboardFile",
                name=name,
                size=24_000_000,
                identity=k,
                closed=True,
                start_ns=start,
                end_ns=start + 62_000_000_000,
            )
            for k, name in enumerate(LOGS)
        ],
    }
    page = open_runs()
    sees = look_at(page)
    page.click("#open-onboard")
    sees.text("#onboard tbody tr:first-child td:first-child", LOGS[0])
    assert not page.is_visible("#list")
    page.click(f"#onboard button[aria-label='Download {LOGS[0]}']")
    until(lambda: lab.station.requests[-1][0] == "transfer")
    assert lab.station.requests[-1][1].name == LOGS[0]
    under_way(transfer("download", LOGS[0], "fetching", 12_000_000))
    sees.text("#onboard .fetching span", "^Fetching 12 MB of 24 MB, 310 kB/s$")
    page.wait_for_selector(f"#onboard button[aria-label='Cancel {LOGS[0]}']")
    copy = lab.data / "onboard" / "quad1" / LOGS[0]
    copy.parent.mkdir(parents=True)
    copy.write_bytes(b"")
    os.truncate(copy, 24_000_000)
    under_way(transfer("download", LOGS[0], "done", 24_000_000))
    link = page.locator("#onboard tbody tr:first-child a")
    assert link.get_attribute("href") == f"/replay/onboard%3Aquad1%3A{LOGS[0][:-5]}"
    page.click("#open-onboard")
    page.wait_for_selector("#list", state="visible")
