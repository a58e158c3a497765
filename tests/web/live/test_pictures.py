"""`/ws/picture`: pictures as they arrive, only while shown, and only over the base's network."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx
import numpy as np
import pytest
import websockets.exceptions

from console.trackers.camera_figures import Figures
from vehicle_link.messages import decode, new
from vehicle_link.topics.measurements import PICTURE, decode_picture, encode_picture
from vehicle_link.topics.table import TOPICS

TOPIC = "camera_picture"
PATIENCE = 20.0


def picture(data: bytes) -> Any:
    return decode(encode_picture(1, data, "quad1"), PICTURE)


def test_a_page_gets_jpegs_while_it_looks_and_none_are_taken_for_nobody(
    site: Any, viewer: httpx.Client, station: Any, until: Callable[..., None]
) -> None:
    assert station.forwarded == set()
    with site.websocket("/ws/picture/camera", site.cookie(viewer)) as page:
        until(lambda: station.forwarded == {TOPIC})
        station.deliver(TOPIC, picture(b"\xff\xd8 one"))
        assert page.recv(PATIENCE) == b"\xff\xd8 one"
        station.deliver(TOPIC, picture(b"\x89PNG"))  # from another node
        assert page.recv(PATIENCE) == "a picture of 4 bytes that is not a JPEG; send JPEG"
        station.deliver(TOPIC, picture(b"\xff\xd8 two"))
        assert page.recv(PATIENCE) == b"\xff\xd8 two"
    until(lambda: station.forwarded == set())


def test_there_are_two_cameras(site: Any, viewer: httpx.Client) -> None:
    with (
        pytest.raises(websockets.exceptions.InvalidStatus) as refused,
        site.websocket("/ws/picture/kitchen", site.cookie(viewer)),
    ):
        pass
    assert refused.value.response.status_code == 403


def test_a_picture_never_crosses_the_radio_and_waits_for_nobody() -> None:
    for name in ("tracker_picture", TOPIC):
        row = TOPICS[name]
        assert not row.on_radio
        assert not row.qos.reliable
        assert 0 < row.newest <= 2
        assert row.type_name == PICTURE


def test_a_page_reads_how_the_camera_sees_in_the_words_of_its_process(
    viewer: httpx.Client, station: Any
) -> None:
    one, other = Figures("0", 30.0, 0.98, 121.0, 0.2), Figures("1", 0.0)
    figures = [new("quadlab_msgs/CameraFigures", **seen._asdict()) for seen in (one, other)]
    station.put("camera_status", new("quadlab_msgs/TrackerStatus", cameras=figures))
    first, second = viewer.get("/api/summary").json()["camera"]["sees"]
    assert first.startswith("camera 0: 30 pictures/s, mean grey level 121 of 255, beacons in 98%")
    assert second == "camera 1: no pictures"


def test_a_jpeg_comes_back_to_the_byte() -> None:
    jpeg = b"\xff\xd8" + bytes(np.random.default_rng(3).integers(0, 256, 40_001, np.uint8))
    assert decode_picture(encode_picture(5, jpeg, "quad1")) == jpeg
