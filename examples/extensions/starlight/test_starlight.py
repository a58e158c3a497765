"""The extension is found, and its client reads frames of a server."""

import socket
import threading
from pathlib import Path

import numpy as np
import pytest
import starlight
from starlight.extension import EXTENSION
from starlight.tracker import SYSTEM, parse

from console.trackers.source import Connection
from quadrotor.errors import MeasurementError, UnreachableError
from quadrotor.extension import PageFeature, PagePanel, TrackingSystem
from quadrotor.extensions import Registry
from web.panels import Panel
from web.static_files import STATIC, CachedFiles

LINE = b'{"t": 12.5, "bodies": {"cf7": [1, 2, 3, 1, 0, 0, 0]}}\n'


def test_all_that_it_offers_can_be_loaded() -> None:
    registry = Registry([("starlight", "starlight", lambda: EXTENSION)])
    assert registry.problems == {}
    for kind in (PageFeature, TrackingSystem):
        assert all(offered.load() is not None for offered in registry.offers(kind).values())


def test_the_tab_can_be_shown() -> None:
    (offer,) = (one for one in EXTENSION.offers if isinstance(one, PagePanel))
    panel = Panel(offer, "starlight", Path(starlight.__file__).parent / "page")
    assert CachedFiles(STATIC, [panel]).problems == []


def test_frames_of_a_server_arrive_as_bodies() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=lambda: server.accept()[0].sendall(2 * LINE), daemon=True).start()
        port = server.getsockname()[1]
        source = SYSTEM.open(Connection("127.0.0.1", port, None, {"quad1": "cf7"}, Path()))
        frames = source.frames()
        (body,) = next(frames).bodies
        assert body.name == "cf7"
        np.testing.assert_array_equal(body.position_w, (1.0, 2.0, 3.0))
        assert next(frames).stamp_ns == 12_500_000_000
        source.close()


@pytest.mark.parametrize("line", [b"{}", b"x", b'{"t": 1, "bodies": {"cf7": [1, 2]}}'])
def test_what_is_no_frame_is_refused(line: bytes) -> None:
    with pytest.raises(MeasurementError):
        parse(line, 0)


def test_a_server_that_is_not_there_is_named() -> None:
    with pytest.raises(UnreachableError, match="no starlight server at"):
        SYSTEM.open(Connection("127.0.0.1", 1, None, {}, Path()))
