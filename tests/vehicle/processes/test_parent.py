"""The vehicle's parent process starts its children while it has a single thread."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

from flight_log import is_closed
from vehicle.onboard_log.repair import FOLDER
from vehicle.processes import parent


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
    flight, comms = "vehicle.flight.process", "vehicle.comms.process"
    repair = f"repair {[torn]}"
    assert done == ["share", flight, comms, repair, comms, repair]


@pytest.mark.parametrize(
    ("stable_s", "is_long"), [(60.0, [False, True, True]), (-1.0, [False, False, False])]
)
def test_only_repeated_early_deaths_of_comms_lead_to_long_pauses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stable_s: float, is_long: list[bool]
) -> None:
    returncodes = iter([None, *[-signal.SIGKILL] * len(is_long), None])  # flight, then comms
    waits: list[list[float]] = []  # s, after each start

    def start(*_: Any, **__: Any) -> Child:
        waits.append([])
        if len(waits) > 1 + len(is_long):
            signal.raise_signal(signal.SIGTERM)
        return Child(next(returncodes))

    monkeypatch.setattr(parent, "STABLE_S", stable_s)
    monkeypatch.setattr(parent, "SHORT_PAUSE_S", 0.01)
    monkeypatch.setattr(parent, "LONG_PAUSE_S", 0.3)
    monkeypatch.setattr(parent, "start", start)
    monkeypatch.setattr(parent, "share", lambda _: None)
    monkeypatch.setattr(parent._Signals, "wait", lambda _, wait_s: waits[-1].append(wait_s or 0.0))
    assert parent.run_vehicle([], tmp_path, 1) == 0
    assert [max(of_one) > 0.01 for of_one in waits[1:-1]] == is_long
