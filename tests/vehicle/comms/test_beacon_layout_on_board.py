"""The one-frame poses on board follow the parameter beacons.layout."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import PRESETS
from quadrotor.errors import MeasurementError
from quadrotor.records import bearings_sample, new_state
from vehicle.comms.bearing_pose import bearing_pose
from vehicle.comms.inbound import Inbound
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle_link.messages import decode
from vehicle_link.topics.table import TOPICS

PLACE = np.array([0.2, -0.3, 1.1])


def solved(known: KnownBeacons, layout: str) -> Any:
    """Return the position found from exact bearings to the beacons of `layout`, level at PLACE."""
    beacons = PRESETS[layout]
    away = beacons.positions_w - PLACE
    away /= np.linalg.norm(away, axis=1)[:, None]
    state = new_state()
    state["position_w"][0] = PLACE
    payload = bearing_pose(bearings_sample(5, beacons.ids, away, 0.02), known, state)
    found = decode(payload, TOPICS["bearing_pose"].type_name).pose.pose.position
    return np.array([found.x, found.y, found.z])


@pytest.mark.parametrize("layout", ["paper", "wide"])
def test_poses_are_found_among_the_beacons_as_they_are_placed(layout: str) -> None:
    known = KnownBeacons(PRESETS[layout])
    assert solved(known, layout) == pytest.approx(PLACE, abs=1e-6)


def test_a_new_layout_counts_at_once_and_a_wrong_one_changes_nothing() -> None:
    inbound = Inbound(None, VehicleClock(), print, print, print)  # type: ignore[arg-type]
    inbound.prepare().join()
    assert solved(inbound._beacons, "paper") == pytest.approx(PLACE, abs=1e-6)
    inbound.set_layout("wide")
    assert solved(inbound._beacons, "wide") == pytest.approx(PLACE, abs=1e-6)
    with pytest.raises(MeasurementError):
        inbound.set_layout("1 0 0 0")
    assert solved(inbound._beacons, "wide") == pytest.approx(PLACE, abs=1e-6)
