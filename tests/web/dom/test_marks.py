"""Event marks on the console page: a key press sets a mark at once, its text may follow."""

from __future__ import annotations

from typing import Any

import pytest

from vehicle_link.messages import new


@pytest.fixture
def marked(page: Any, station: Any, look: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the page while run r1 is recorded; the station answers and publishes."""
    plain = station._call_blocking

    def call(service: str, request: Any) -> Any:
        answer = plain(service, request)
        if service == "mark" and answer.accepted:
            known = station.times.setdefault(request.id, 42.3 + len(station.times))
            answer = new(
                "quadlab_msgs/srv/Mark_Response",
                accepted=True,
                run_id="r1",
                time=known,
                logged=True,
            )
            fields = {"id": request.id, "text": request.text, "requester": request.requester}
            mark = {"type": "mark", "run_id": "r1", "time": known, **fields}
            station._hub.publish_from_thread(mark)
        return answer

    put = station.put

    def put_of_run(topic: str, message: Any) -> None:
        if topic == "station_status":
            message.run_id = "r1"
        put(topic, message)

    monkeypatch.setattr(station, "put", put_of_run)
    monkeypatch.setattr(station, "times", {}, raising=False)
    monkeypatch.setattr(station, "_call_blocking", call)
    look.text("#record-note", "^r1$")  # before that, its marks are those of another run
    page.wait_for_selector("#mark:not([disabled])")
    return page


def marks(station: Any) -> list[Any]:
    return [request for service, request in station.requests if service == "mark"]


def test_the_key_marks_on_any_tab_at_the_time_of_the_press_and_once(
    marked: Any, look: Any, station: Any, until: Any
) -> None:
    marked.click("[data-tab=gains]")
    marked.evaluate("document.activeElement.blur()")
    marked.keyboard.down("m")
    marked.keyboard.down("m")  # the repetition of a held key
    marked.keyboard.up("m")
    look.text("#mark-note", r"^Marked 00:42\.3$")
    [request] = marks(station)
    assert request.text == ""
    assert request.pressed_ns > 0
    assert marked.is_visible("#tab-gains"), "nothing was opened"


def test_a_text_typed_afterwards_goes_to_the_same_mark(
    marked: Any, look: Any, station: Any, until: Any
) -> None:
    marked.click("#mark")
    marked.wait_for_selector("#marks input")
    marked.fill("#marks input", "gust from the door")
    marked.keyboard.press("Enter")
    look.text("#mark-note", "Mark saved")
    first, second = marks(station)
    assert (second.id, second.text, second.pressed_ns) == (first.id, "gust from the door", 0)
    assert marked.locator("#marks li").count() == 1


def test_marks_of_others_appear_and_those_of_another_run_do_not(
    marked: Any, look: Any, station: Any
) -> None:
    for run, text in (("r0", "of yesterday"), ("r1", "from grace")):
        station._hub.publish_from_thread(
            {
                "type": "mark",
                "id": f"mark-{run}",
                "run_id": run,
                "time": 5.0,
                "text": text,
                "requester": "grace",
            }
        )
    look.value("#marks input", "from grace")
    assert marked.locator("#marks li").count() == 1


def test_typing_an_m_marks_nothing(marked: Any, station: Any) -> None:
    marked.click("[data-tab=gains]")
    marked.fill("#search", "")
    marked.type("#search", "mass m")
    assert marks(station) == []


def test_a_refusal_is_shown_with_its_reason(marked: Any, look: Any, station: Any) -> None:
    station.refusal = "nothing is being recorded, so there is no log to mark; press Record first"
    marked.evaluate("document.activeElement.blur()")
    marked.keyboard.press("m")
    look.text("#mark-note", "^Not marked: nothing is being recorded")
