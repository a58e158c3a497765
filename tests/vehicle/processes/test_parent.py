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

    monkeypatch.setattr(parent, "LONG_PAUSE_S", 0.0)
    monkeypatch.setattr(parent, "start", start)
    monkeypatch.setattr(parent, "share", lambda _: done.append("share"))
    monkeypatch.setattr(parent, "_repair", lambda paths: done.append(f"repair {paths}"))
    assert parent.run_vehicle([], tmp_path, 1) == 0
    flight, comms = "vehicle.flight.process", "vehicle.comms.process"
    repair = f"repair {[torn]}"
    assert done == ["share", flight, comms, repair, comms, repair]
