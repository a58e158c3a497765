"""Motion capture systems that do not answer, through the library itself."""

from __future__ import annotations

import pytest

from console.trackers import motion_capture
from console.trackers.motion_capture import MotionCaptureSource
from quadrotor.errors import UnreachableError, UsageError
from tests.waiting import free_port


@pytest.mark.parametrize("system", motion_capture.SYSTEMS)
def test_a_server_that_does_not_answer_is_named_also_where_the_library_waits_for_ever(
    system: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motion_capture, "PATIENCE", 1.0)
    port = free_port()
    source = MotionCaptureSource(system, "127.0.0.1", port)
    with pytest.raises(UnreachableError, match=rf"{system} server at 127.0.0.1:{port}"):
        next(source.frames())
    source.close()


def test_a_host_that_no_one_knows_is_named() -> None:
    with pytest.raises(UnreachableError, match="no host mocap.invalid is known"):
        MotionCaptureSource("vrpn", "mocap.invalid", 3883)


def test_without_the_library_the_package_to_install_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(motion_capture, "LIBRARY", "motioncapture_that_is_not_there")
    with pytest.raises(UsageError, match="pip install"):
        MotionCaptureSource("vicon", "127.0.0.1", 801)
