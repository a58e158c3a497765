"""Motion capture systems that do not answer, through the library itself."""

from __future__ import annotations

import importlib.util
import sys
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from extensions.mocap import clients
from extensions.mocap.clients import NATNET, QTM, VICON, VRPN, MotionCapture, MotionCaptureSource
from quadlab.commands.tracker import Tracker
from quadrotor.errors import UnreachableError, UsageError
from tests.waiting import free_port


@pytest.mark.parametrize("system", [VICON, NATNET, QTM, VRPN], ids=lambda one: one.name)
def test_a_server_that_does_not_answer_is_named_also_where_the_library_waits_for_ever(
    system: MotionCapture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "PATIENCE", 1.0)
    port = free_port()
    source = MotionCaptureSource(system, "127.0.0.1", port)
    with pytest.raises(UnreachableError, match=rf"{system.name} server at 127.0.0.1:{port}"):
        next(source.frames())
    source.close()


def test_frames_of_the_library_are_bodies_stamped_where_they_are_received() -> None:
    bodies = {"rigid_bodies": "cf7(0.5,-0.5,1,0.6,0,0,0.8)", "frequency": "100"}
    mock = MotionCapture("mock", "mock", lambda host, port: bodies)
    source = MotionCaptureSource(mock, "127.0.0.1", 1)
    frames = source.frames()
    first, second = next(frames), next(frames)
    source.close()
    for _ in frames:  # ends, and the library's process with it
        pass
    [body] = first.bodies
    assert body.name == "cf7"
    np.testing.assert_allclose(body.position_w, (0.5, -0.5, 1.0))
    assert body.quaternion_wb is not None
    np.testing.assert_allclose(body.quaternion_wb, (0.6, 0.0, 0.0, 0.8), atol=1e-6)
    assert first.stamp_ns is None
    assert second.received_ns > first.received_ns


def test_vrpn_poses_are_stamped_half_way_since_the_library_looked_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rotation = SimpleNamespace(w=1.0, x=0.0, y=0.0, z=0.0)
    body = SimpleNamespace(position=(0.0, 0.0, 1.0), rotation=rotation)
    client = SimpleNamespace(waitForNextFrame=lambda: None, rigidBodies={"cf7": body})
    library = SimpleNamespace(connect=lambda system, settings: client)
    monkeypatch.setitem(sys.modules, "motioncapture", library)
    for system, stamps in (("vrpn", [5, 20]), ("optitrack", [10, 30])):
        times, reported = iter([0, 0, 10, 30]), list[Any]()
        monkeypatch.setattr(clients, "monotonic_ns", partial(next, times))
        with pytest.raises(StopIteration):
            clients._read(system, {}, reported.append)
        assert [stamp for stamp, _ in reported[1:]] == stamps


def test_a_host_that_no_one_knows_is_named() -> None:
    with pytest.raises(UnreachableError, match=r"no host mocap\.invalid is known"):
        MotionCaptureSource(VRPN, "mocap.invalid", 3883)


def test_without_the_library_the_package_to_install_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match="scripts/setup trackers"):
        Tracker("vicon").check()
