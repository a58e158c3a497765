"""The one-frame poses on board follow the parameter beacons.layout."""

from __future__ import annotations

import numpy as np
import pytest

from bearing_sim.beacons import PRESETS
from quadrotor.errors import MeasurementError
from quadrotor.records import new_state
from vehicle.comms.bearing_pose import BearingPose
from vehicle.comms.inbound import Inbound
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle_link import topics
from vehicle_link.messages import decode

PLACE = np.array([0.2, -0.3, 1.1])


def solved(poses: BearingPose, layout: str) -> np.ndarray:
    """The position found from exact bearings to the beacons of `layout`, level at PLACE."""
    beacons = PRESETS[layout]
    away = beacons.positions_w - PLACE
    away /= np.linalg.norm(away, axis=1)[:, None]
    state = new_state()
    state["position_w"][0] = PLACE
    payload = poses.solve(5, beacons.ids.tolist(), away, 0.02, state)
    found = decode(payload, topics.TOPICS["bearing_pose"].type_name).pose.pose.position
    return np.array([found.x, found.y, found.z])


def test_poses_are_found_among_the_beacons_placed_last() -> None:
    poses = BearingPose(PRESETS["paper"])
    assert solved(poses, "paper") == pytest.approx(PLACE, abs=1e-6)
    poses.place(PRESETS["wide"])
    assert solved(poses, "wide") == pytest.approx(PLACE, abs=1e-6)
    poses.place(PRESETS["paper"])
    assert solved(poses, "paper") == pytest.approx(PLACE, abs=1e-6)


def test_a_new_layout_gets_a_solver_of_its_own_and_a_wrong_one_changes_nothing() -> None:
    inbound = Inbound(None, VehicleClock(), print, print, print)  # type: ignore[arg-type]
    inbound.prepare().join()
    first = inbound._solver
    inbound.lay_out("paper")
    assert inbound._solver is first  # as it was
    inbound.lay_out("wide")
    assert inbound._solver is not first
    assert inbound._solver is not None
    assert solved(inbound._solver, "wide") == pytest.approx(PLACE, abs=1e-6)
    second = inbound._solver
    with pytest.raises(MeasurementError):
        inbound.lay_out("1 0 0 0")
    assert inbound._solver is second
