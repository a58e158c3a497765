"""An empty simulated battery is swapped, and the vehicle flies again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.timeout(240)
CHARGE = "simulator.battery_charge"


def test_an_empty_battery_lands_the_vehicle_and_a_swapped_one_flies_it_again(
    lab: Any, until: Callable[..., Any]
) -> None:
    def charge(share: float) -> int:
        answer = lab.browser.put("/api/parameters", json={"values": {CHARGE: share}})
        return int(answer.status_code)

    lab.hover()
    in_flight = lab.command("simulation", action="swap_battery")
    assert in_flight.status_code == 409
    assert "motors are on" in in_flight.json()["error"]
    assert lab.command("simulation", action="reset").status_code == 409
    lab.start("fly_to", x=1.0, y=0.5, z=1.0)
    until("the way there", lambda: lab.status().get("behavior") == "fly_to")
    lab.reach(behavior="hover")
    assert until("the simulator's parameters", lambda: charge(0.02) == 200)
    lab.reach(mode="emergency_land")
    lab.reach(mode="ready", armed=False)
    refused = lab.command("arm")
    assert refused.status_code == 409
    assert "battery" in refused.json()["error"]
    lab.do("simulation", action="swap_battery")
    lab.ready()
    assert charge(0.3) == 200  # set again, to another share
    assert charge(1.0) == 200
    lab.do("simulation", action="reset")  # a metre away, which the estimate must follow
    lab.hover()
    lab.start("land")
    lab.reach(mode="ready", armed=False)
