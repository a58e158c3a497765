"""Labels of runs: notes, tags, and what the search finds by them."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from console.catalogue.catalogue import DATABASE, Catalogue
from console.catalogue.marks import mark_counts, marks_of, store_mark
from console.catalogue.notes import KEPT, newest_notes, notes_history, write_notes
from console.catalogue.search import RunSearch
from console.catalogue.tables import Mark
from console.catalogue.tags import LONGEST, MOST, all_tags, change_tags, tags_of
from console.runs.trash import delete_run
from quadrotor.errors import ParameterError, StorageError
from tests.support.runs import run_entry


def enter(catalogue: Catalogue, name: str, **fields: object) -> None:
    catalogue.add(run_entry(name, **fields))


@pytest.fixture
def catalogue(tmp_path: Path) -> Catalogue:
    made = Catalogue(tmp_path)
    for i, name in enumerate(("r0", "r1", "r2")):
        enter(made, name, start_ns=1000 + i)
    return made


def found(catalogue: Catalogue, **search: object) -> list[str]:
    wanted = RunSearch(**search)  # type: ignore[arg-type]
    ids = [run.id for run in catalogue.runs(wanted)]
    assert catalogue.count(wanted) == len(ids)
    return ids


def test_the_last_one_who_writes_wins_and_is_told_what_stood_there(catalogue: Catalogue) -> None:
    anna = write_notes(catalogue, "r1", "gusty", "anna", seen=0)
    assert anna.replaced is None
    grace = write_notes(catalogue, "r1", "calm", "grace", seen=0)
    assert grace.replaced is not None
    assert (grace.replaced.text, grace.replaced.author) == ("gusty", "anna")
    assert catalogue.get("r1").notes == "calm"
    assert write_notes(catalogue, "r1", "calm, cold", "grace", grace.note.version).replaced is None
    history = [(note.text, note.author) for note in notes_history(catalogue, "r1")]
    assert history == [("calm, cold", "grace"), ("calm", "grace"), ("gusty", "anna")]
    assert newest_notes(catalogue, ["r0", "r1"]).keys() == {"r1"}


def test_notes_of_a_catalogue_without_history_are_its_first_text(catalogue: Catalogue) -> None:
    catalogue.update("r1", notes="from long ago")
    write_notes(catalogue, "r1", "new", "anna")
    assert [note.text for note in notes_history(catalogue, "r1")] == ["new", "from long ago"]


def test_the_history_of_notes_is_bounded_and_the_same_text_is_no_entry(
    catalogue: Catalogue,
) -> None:
    for i in range(KEPT + 10):
        write_notes(catalogue, "r1", f"text {i}", "anna")
        write_notes(catalogue, "r1", f"text {i}", "grace")
    history = notes_history(catalogue, "r1")
    assert len(history) == KEPT + 1
    assert history[0].text == f"text {KEPT + 9}"
    assert {note.author for note in history} == {"anna"}


def test_tags_are_spelled_as_the_first_one_and_belong_to_all_or_none(catalogue: Catalogue) -> None:
    assert change_tags(catalogue, ["r0", "r1"], [" Wind ", "lab  2"], []) == {
        "r0": ["lab 2", "Wind"],
        "r1": ["lab 2", "Wind"],
    }
    assert change_tags(catalogue, ["r2"], ["WIND"], []) == {"r2": ["Wind"]}
    assert all_tags(catalogue) == {"Wind": 3, "lab 2": 2}
    assert change_tags(catalogue, ["r0"], [], ["wind"]) == {"r0": ["lab 2"]}
    with pytest.raises(StorageError, match="no run 'nope'"):
        change_tags(catalogue, ["r0", "nope"], ["new"], [])
    assert tags_of(catalogue, ["r0"]) == {"r0": ["lab 2"]}


@pytest.mark.parametrize("tag", ["", "  ", "a,b", "x" * (LONGEST + 1), "\x07bell"])
def test_what_is_no_tag_is_refused_with_what_is_allowed(catalogue: Catalogue, tag: str) -> None:
    with pytest.raises(ParameterError, match=f"1 to {LONGEST} characters"):
        change_tags(catalogue, ["r0"], ["good", tag], [])
    assert tags_of(catalogue, ["r0"]) == {}


def test_a_run_has_only_so_many_tags(catalogue: Catalogue) -> None:
    change_tags(catalogue, ["r0"], [f"t{i}" for i in range(MOST)], [])
    with pytest.raises(ParameterError, match=f"more than {MOST} tags"):
        change_tags(catalogue, ["r0"], ["one more"], [])
    assert len(change_tags(catalogue, ["r0"], ["one more"], ["t0"])["r0"]) == MOST


def test_every_word_must_stand_somewhere_in_what_is_known_of_a_run(catalogue: Catalogue) -> None:
    change_tags(catalogue, ["r0"], ["wind 100%"], [])
    write_notes(catalogue, "r0", "New propellers", "anna")
    write_notes(catalogue, "r1", "new battery", "anna")
    store_mark(catalogue, Mark("r2", "mark-0001", 5, 1.0, "gust from the door", "anna"))
    assert found(catalogue, words="new") == ["r1", "r0"]
    assert found(catalogue, words="NEW 100%") == ["r0"]
    assert found(catalogue, words="door") == ["r2"]
    assert found(catalogue, words="quad1 ada") == ["r2", "r1", "r0"]
    assert found(catalogue, words="_") == []
    assert found(catalogue, tag="WIND 100%") == ["r0"]
    assert found(catalogue, tag="wind") == []
    assert found(catalogue, tag="wind_100%") == []


def test_the_bounds_of_time_hold_the_first_instant_and_not_the_last(catalogue: Catalogue) -> None:
    assert found(catalogue, since_ns=1001) == ["r2", "r1"]
    assert found(catalogue, until_ns=1001) == ["r0"]
    assert found(catalogue, since_ns=1001, until_ns=1002) == ["r1"]


def test_a_deleted_run_is_not_found_and_its_tags_do_not_count(catalogue: Catalogue) -> None:
    change_tags(catalogue, ["r0", "r1"], ["wind"], [])
    delete_run(catalogue, "r1", "anna")
    assert found(catalogue) == ["r2", "r0"]
    assert all_tags(catalogue) == {"wind": 1}
    for act in (catalogue.get, catalogue.resolve):
        with pytest.raises(StorageError, match="r1 was deleted; undo that"):
            act("r1")


def test_a_mark_gets_its_text_later_and_marks_are_in_the_order_of_time(
    catalogue: Catalogue,
) -> None:
    store_mark(catalogue, Mark("r0", "mark-0002", 9, 4.0, "", "anna"))
    store_mark(catalogue, Mark("r0", "mark-0001", 5, 2.0, "first", "anna"))
    store_mark(catalogue, Mark("r0", "mark-0002", 9, 4.0, "second", "anna"))
    assert [mark.text for mark in marks_of(catalogue, "r0")] == ["first", "second"]
    assert mark_counts(catalogue, ["r0", "r1"]) == {"r0": 2}


def test_a_catalogue_of_an_older_version_gains_the_tables_and_keeps_its_runs(
    tmp_path: Path, catalogue: Catalogue
) -> None:
    catalogue.close()
    with sqlite3.connect(tmp_path / DATABASE) as database:
        for table in ("run_notes", "run_tags", "run_marks", "run_trash"):
            database.execute(f"DROP TABLE {table}")
    again = Catalogue(tmp_path)
    assert found(again) == ["r2", "r1", "r0"]
    change_tags(again, ["r0"], ["wind"], [])
    again.close()
