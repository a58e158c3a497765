"""Events outlive the page's process: the station keeps them, and a page begins with them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.disk_worker import DiskWorker
from console.parameters.history import ParameterHistory, RecordedChange
from console.runs.event_book import KEPT, SPARE, EventBook, KeptEvent
from web.live.events import EventHub, kept_lines

SECOND_NS = 1_000_000_000


def said(k: int, level: int = 20, kinds: str = "") -> KeptEvent:
    return KeptEvent(k * SECOND_NS, k * SECOND_NS + 5, level, "quad1", kinds, f"line {k}")


def test_events_are_read_by_another_process_in_their_order(tmp_path: Path) -> None:
    worker = DiskWorker("lists")
    book = EventBook(Catalogue(tmp_path).engine, "quad1")
    for k in range(1, 6):
        worker.put(partial(book.add, said(k)))
    worker.close(3.0)
    EventBook(Catalogue(tmp_path).engine, "quad2").add(said(9))
    assert EventBook(Catalogue(tmp_path).engine, "quad1").newest() == [said(k) for k in range(1, 6)]


def test_old_events_are_removed_and_the_newest_are_kept(tmp_path: Path) -> None:
    book = EventBook(Catalogue(tmp_path).engine, "quad1")
    for k in range(KEPT + 2 * SPARE):
        book.add(said(k))
    kept = book.newest()
    assert (len(kept), kept[-1].text) == (KEPT, f"line {KEPT + 2 * SPARE - 1}")


def test_a_page_begins_with_events_and_changes_in_one_order_and_knows_acts(tmp_path: Path) -> None:
    engine = Catalogue(tmp_path).engine
    book, history = EventBook(engine, "quad1"), ParameterHistory(engine, "quad1")
    book.add(said(1, 30))
    book.add(said(4, kinds="act delayed"))
    at_ns = 2 * SECOND_NS
    history.add([RecordedChange("kp", 4.0, 9.0, "ann", at_ns, at_ns, "run9", 5)])
    hub = EventHub()
    hub.begin(kept_lines(book, history))
    assert [line["stamp"] for line in hub.lines] == [1.0, 2.0, 4.0]
    first, change, last = hub.lines
    assert (first["level"], first["text"], first["act"]) == ("warn", "line 1", False)
    assert (change["name"], change["old"], change["value"]) == ("kp", 4.0, 9.0)
    assert (last["level"], last["act"]) == ("info", True)
