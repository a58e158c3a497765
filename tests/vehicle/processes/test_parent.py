"""The vehicle's parent process starts its children while it has a single thread."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

from flight_log import is_closed
from vehicle.onboard_log.repair import FOLDER
from vehicle.processes import parent
from vehicle.safety.parameters import SafetyParameters


class Child:
    """A child process that ends at once, or at SIGTERM."""

    pid = 1

    def __init__(self, returncode: int | None) -> None:
        self.returncode = returncode

    def poll(self) -> int | None:
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        return self.returncode or 0

    def terminate(self) -> None:
        self.returncode = 0

    kill = terminate


def test_a_torn_log_is_repaired_after_the_start_of_what_could_be_a_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torn = tmp_path / FOLDER / "quad1_a.mcap"
    torn.parent.mkdir()
    torn.write_bytes(b"\x89MCAP0\r\n")
    assert not is_closed(torn)
    done: list[str] = []
    ends = iter([None, -signal.SIGKILL, None])  # comms is killed

    def start(module: str, *_: Any, **__: Any) -> Child:
        done.append(module)
        if len(done) > 4:
            signal.raise_signal(signal.SIGTERM)
        return Child(next(ends))

    monkeypatch.setattr(parent, "SHORT_PAUSE_S", 0.0)
    monkeypatch.setattr(parent, "start", start)
    monkeypatch.setattr(parent, "share", lambda _: done.append("share"))
    monkeypatch.setattr(parent, "_repair", lambda paths: done.append(f"repair {paths}"))
    assert parent.run_vehicle([], tmp_path, 1) == 0
    flight, comms = "vehicle.in_memory", "vehicle.comms.process"  # without ports
    repair = f"repair {[torn]}"
    assert done == ["share", flight, comms, repair, comms, repair]


def test_comms_is_started_again_once_the_system_has_a_descriptor_and_the_reason_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    full = OSError(24, "Too many open files")
    ends = [None, -signal.SIGKILL, full, full, full, None]

    def start(*_: Any, **__: Any) -> Child:
        end = ends.pop(0)
        if isinstance(end, OSError):
            raise end
        if not ends:
            signal.raise_signal(signal.SIGTERM)
        return Child(end)

    monkeypatch.setattr(parent, "SHORT_PAUSE_S", 0.0)
    monkeypatch.setattr(parent, "start", start)
    monkeypatch.setattr(parent, "share", lambda _: None)
    assert parent.run_vehicle([], tmp_path, 1) == 0
    assert ends == []
    told = capfd.readouterr()
    assert (told.out + told.err).count("restarted yet: Too many open files; trying on") == 1


@pytest.mark.parametrize(
    ("died_at", "is_long"),
    [
        ([0.0, 1.0, 2.0, 3.0, 9.0], [False, False, False, True, True]),
        ([0.0, 9.0, 18.0, 27.0, 60.0], [False, False, False, True, False]),  # lived for 9 s each
        ([0.0, 12.0, 24.0, 36.0, 48.0], [False] * 5),
    ],
)
def test_a_vehicle_outlasts_three_deaths_of_comms_in_half_a_minute_and_lands_at_more(
    died_at: list[float], is_long: list[bool]
) -> None:
    deaths, safety = parent.CommsDeaths(), SafetyParameters()
    until_landing = safety.link_timeout + safety.link_land_after
    pauses = [deaths.pause(t) for t in died_at]
    assert [pause > until_landing for pause in pauses] == is_long
    assert {pause for pause in pauses if pause <= until_landing} == {parent.SHORT_PAUSE_S}
    assert safety.link_timeout > parent.SHORT_PAUSE_S
