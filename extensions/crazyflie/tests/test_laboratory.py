"""Test of `quadlab up --board crazyflie`: a simulated Crazyflie under the whole laboratory."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.conftest import Laboratory, until

pytestmark = pytest.mark.timeout(240)


def test_it_starts_is_armed_and_shows_its_link(tmp_path: Path) -> None:
    lab = Laboratory(tmp_path / "data", "--board", "crazyflie")
    try:
        lab.sign_in()
        lab.ready()
        started = [" ".join(words) for words in lab.processes().values()]
        assert any("--board crazyflie" in words for words in started)
        until("arming", lambda: lab.command("arm").status_code == 200, 20)
        lab.reach(mode="armed")
        # Its set-points are sent with each of its 100 samples a second.
        until("commands", lambda: lab.status()["board_command_rate"] > 50.0, 20)
        lab.do("disarm")
        lab.reach(mode="ready")
    finally:
        lab.close()
