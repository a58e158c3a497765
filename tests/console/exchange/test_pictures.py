"""The cameras' pictures are recorded with a run, at a limited rate, and at no other time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from flight_log import read_log
from tests.support.station import LinkedStation
from tests.waiting import wait_for
from vehicle_link.topics.measurements import PICTURE, decode_picture, encode_picture
from vehicle_link.topics.table import TOPICS

JPEG = b"\xff\xd8"
START_NS, PERIOD_NS = 5_000_000_000, 100_000_000


@pytest.fixture
def linked(tmp_path: Path) -> Iterator[LinkedStation]:
    linked = LinkedStation(tmp_path, {"station.recorder.pictures": 5.0})
    yield linked
    linked.close()


def test_a_run_has_its_pictures_at_the_rate_that_is_set_and_none_are_made_without_one(
    linked: LinkedStation,
) -> None:
    station, camera = linked.station, linked.page.advertise(TOPICS["camera_picture"])
    assert not camera.has_subscribers
    station.runs.by_hand(True, "ada")
    wait_for(lambda: camera.has_subscribers)
    for k in range(20):  # 2 s at 10 Hz; wait for each, because the station holds only two
        stamp_ns = START_NS + k * PERIOD_NS
        before = station.parts.pictures._last.get("camera_picture")
        camera.put(encode_picture(stamp_ns, JPEG + bytes([k]), "quad1"), stamp_ns)
        if k % 2 == 0:
            wait_for(lambda: station.parts.pictures._last.get("camera_picture") != before)  # noqa: B023
    run_id = station.runs.by_hand(False, "ada")
    wait_for(lambda: not camera.has_subscribers)
    assert station.runs.recorder.wait_idle(10.0)
    messages = list(read_log(linked.catalogue.resolve(run_id), {"/quad1/camera_picture"}))
    assert [decode_picture(one.payload)[2] for one in messages] == list(range(0, 20, 2))
    assert {one.type_name.replace("/msg/", "/") for one in messages} == {PICTURE}
    assert messages[1].publish_ns == START_NS + 2 * PERIOD_NS


def test_pictures_that_are_switched_off_are_not_recorded(linked: LinkedStation) -> None:
    station, camera = linked.station, linked.page.advertise(TOPICS["tracker_picture"])
    station.runs.by_hand(True, "ada")
    wait_for(lambda: camera.has_subscribers)
    station.parts.store.change({"station.recorder.pictures": 0.0}, "ada")
    wait_for(lambda: not camera.has_subscribers)
