"""The checklist of the day: ticks last for a day, items stay, and a bad file is told."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import pytest

from extensions.checklist.store import FILE, USUAL, ChecklistStore
from quadrotor.errors import RefusedError, StorageError

MORNING = datetime.datetime(2026, 1, 31, 9, 30)


class Calendar:
    def __init__(self) -> None:
        self.now = MORNING

    def __call__(self) -> datetime.datetime:
        return self.now


@pytest.fixture
def calendar() -> Calendar:
    return Calendar()


@pytest.fixture
def store(tmp_path: Path, calendar: Calendar) -> ChecklistStore:
    return ChecklistStore(tmp_path, calendar)


def ticked(store: ChecklistStore) -> dict[str, str]:
    return {one.text: one.tick.by for one in store.items() if one.tick}


def test_a_tick_names_who_did_it_and_is_gone_the_next_day(
    store: ChecklistStore, calendar: Calendar, tmp_path: Path
) -> None:
    assert [one.text for one in store.items()] == list(USUAL)
    store.tick(USUAL[1], "anna", done=True)
    store.tick(USUAL[2], "ben", done=True)
    store.tick(USUAL[2], "ben", done=False)
    assert ticked(ChecklistStore(tmp_path, calendar)) == {USUAL[1]: "anna"}
    calendar.now += datetime.timedelta(hours=14)
    assert ticked(store) == {USUAL[1]: "anna"}
    calendar.now += datetime.timedelta(hours=1)
    assert ticked(store) == {}


def test_new_items_keep_the_ticks_of_those_that_stay(store: ChecklistStore) -> None:
    store.tick(USUAL[0], "anna", done=True)
    store.write([USUAL[0], "  Fans \n off ", "", USUAL[0]])
    assert [one.text for one in store.items()] == [USUAL[0], "Fans off"]
    assert ticked(store) == {USUAL[0]: "anna"}
    with pytest.raises(RefusedError, match="no item 'Batteries charged'; somebody changed it"):
        store.tick("Batteries charged", "anna", done=True)


@pytest.mark.parametrize("content", ["", "[]", '{"items": 3}', "\x00"])
def test_a_file_that_is_no_checklist_is_told_and_kept(
    store: ChecklistStore, tmp_path: Path, content: str
) -> None:
    file = tmp_path / FILE
    file.write_text(content)
    for act in (store.items, lambda: store.tick(USUAL[0], "a", done=True)):
        with pytest.raises(StorageError, match="is no checklist; mend it, or remove it"):
            act()
    assert file.read_text() == content


def test_operators_write_and_tick_and_a_long_list_is_refused(site: Any) -> None:
    operator = site.sign_in()
    label = operator.get("/api/session").json()["label"]
    answer = operator.put("/api/checklist", json={"items": ["Nets closed", "Fans off"]})
    assert answer.status_code == 200, answer.text
    assert [one["text"] for one in answer.json()] == ["Nets closed", "Fans off"]
    body = {"item": "Fans off", "done": True}
    assert operator.post("/api/checklist/tick", json=body).status_code == 200
    _, second = operator.get("/api/checklist").json()
    assert (second["text"], second["by"]) == ("Fans off", label)
    assert operator.post("/api/checklist/tick", json=body | {"item": "x"}).status_code == 409
    assert operator.put("/api/checklist", json={"items": ["x"] * 41}).status_code == 422
