"""`quadlab up --board betaflight`: the real firmware in its process, flown from the page's door."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.conftest import Laboratory
from vehicle.simulator.betaflight.process import FIRMWARE

pytestmark = pytest.mark.timeout(300)


@pytest.mark.skipif(not FIRMWARE.exists(), reason="no Betaflight: scripts/betaflight builds it")
def test_it_hovers_and_lands_on_the_real_firmware(tmp_path: Path) -> None:
    lab = Laboratory(tmp_path, "--board", "betaflight").sign_in()
    try:
        lab.hover()
        assert lab.status()["tick_rate"] == pytest.approx(250.0, abs=10.0)
        assert 14.0 < lab.summary()["battery"]["voltage"] < 16.8
        lab.start("land")
        lab.reach(mode="ready")
    finally:
        lab.close()
