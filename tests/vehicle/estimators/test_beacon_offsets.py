"""A beacon whose bearings are biased is noticed, named if possible, and reported once."""

from __future__ import annotations

import math
import zlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bearing_sim.beacons import PAPER_BEACONS, PRESETS, Beacons
from bearing_sim.emulator import perturbed
from vehicle import mailbox
from vehicle.estimators.beacon_offsets import BeaconOffsets, Offset
from vehicle.estimators.suspect_beacon import UNIDENTIFIED, SuspectBeacon
from vehicle.modes import Flag

SIGMA = math.radians(1.5)
PERIOD = 1.0 / 30.0


class Flight:
    """Frames of beacons at 30 Hz from a vehicle that moves and turns a little."""

    def __init__(self, name: str, beacons: Beacons = PAPER_BEACONS) -> None:
        seed = zlib.crc32(name.encode())
        print(f"seed {seed}")
        self.random = np.random.default_rng(seed)
        self.beacons = beacons
        self.biases: dict[
            int, tuple[float, float, float]
        ] = {}  # deg, rotation vectors in body axes
        self.error = np.zeros(6)  # m, rad: of the pose at which residuals are computed
        self.offsets = BeaconOffsets()
        self.time = 0.0

    def fly(self, seconds: float, tracked: bool) -> Offset | None:
        for _ in range(round(seconds / PERIOD)):
            self.time += PERIOD
            self.frame(tracked)
        return self.offsets.suspect

    def frame(self, tracked: bool) -> None:
        t = self.time
        position = np.array([0.3 * np.sin(t), 0.3 * np.cos(0.7 * t), 1.0])
        R_wb = Rotation.from_euler("ZYX", [0.5 * np.sin(0.4 * t), 0.03, -0.02])
        ids = self.beacons.ids.tolist()
        seen = []
        directions = R_wb.inv().apply(self.beacons.positions_w - position)
        for k, id in enumerate(ids):
            if id in self.biases:
                turn = Rotation.from_rotvec(np.radians(self.biases[id]))
                directions[k] = turn.apply(directions[k])
            noise = SIGMA * self.random.normal(size=2)
            x, y, z = (directions[k] / np.linalg.norm(directions[k])).tolist()
            seen.append(perturbed((x, y, z), *noise.tolist()))
        x, y, z, w = (Rotation.from_rotvec(self.error[3:]) * R_wb).as_quat()
        self.offsets.frame(
            t,
            ids,
            self.beacons.positions_w,
            np.array(seen),
            SIGMA,
            position + self.error[:3],
            np.array([w, x, y, z]),
            tracked,
        )


@pytest.mark.parametrize("tracked", [True, False])
def test_good_bearings_raise_no_suspicion_in_two_minutes(tracked: bool) -> None:
    flight = Flight(f"good {tracked}")
    for _ in range(120):
        assert flight.fly(1.0, tracked) is None


@pytest.mark.parametrize("id", [1, 2, 3, 4])
@pytest.mark.parametrize("turn", [(5.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, 5.0)])
def test_with_the_tracker_one_of_four_beacons_is_named_with_its_offset(
    id: int, turn: tuple[float, float, float]
) -> None:
    flight = Flight(f"tracked {id} {turn}")
    flight.error[:] = 0.004, -0.003, 0.005, 0.004, -0.003, 0.006  # the error of the tracker
    assert flight.fly(4.0, True) is None
    flight.biases[id] = turn
    found = flight.fly(5.0, True)
    assert found is not None
    assert found.beacon == id
    assert 1.5 < math.degrees(found.angle) < 5.5
    flight.biases.clear()
    assert flight.fly(15.0, True) is None


def test_without_the_tracker_four_beacons_tell_that_one_is_off_and_not_which() -> None:
    flight = Flight("untracked four")
    flight.biases[2] = (5.0, 0.0, 0.0)
    flight.error[:] = 0.05, -0.06, 0.02, 0.03, 0.02, -0.02  # the bias's effect on the pose
    found = flight.fly(8.0, False)
    assert found is not None
    assert found.beacon is None
    named = flight.fly(4.0, True)  # the tracker is back
    assert named is not None
    assert named.beacon == 2


@pytest.mark.parametrize("id", [1, 4, 7])
def test_without_the_tracker_one_of_eight_beacons_is_named(id: int) -> None:
    flight = Flight(f"untracked eight {id}", PRESETS["eight"])
    flight.biases[id] = (0.0, 5.0, 0.0)
    flight.error[:] = 0.05, -0.06, 0.02, 0.03, 0.02, -0.02
    found = flight.fly(8.0, False)
    assert found is not None
    assert found.beacon == id


@pytest.mark.parametrize("tracked", [True, False])
def test_bearings_that_are_all_turned_or_seen_from_a_wrong_pose_are_no_single_beacons_fault(
    tracked: bool,
) -> None:
    flight = Flight(f"all turned {tracked}")
    flight.biases = dict.fromkeys((1, 2, 3, 4), (0.0, 0.0, 3.0))
    flight.error[:3] = 0.03, 0.02, 0.0
    for _ in range(30):
        assert flight.fly(1.0, tracked) is None


def test_two_beacons_that_are_off_are_told_without_a_name_or_with_one_of_theirs() -> None:
    flight = Flight("two of eight", PRESETS["eight"])
    flight.biases = {2: (0.0, 5.0, 0.0), 6: (5.0, 0.0, 0.0)}
    found = flight.fly(10.0, True)
    assert found is not None
    assert found.beacon in (None, 2, 6)


def test_it_is_told_once_at_the_beginning_and_once_at_the_end() -> None:
    said: list[tuple[str, int]] = []
    suspect = SuspectBeacon(lambda line, level: said.append((line, level)))
    suspect.check(None, False, "")
    for angle in (0.07, 0.08, 0.09):
        suspect.check(Offset(3, angle), True, "")
    assert (suspect.flags, suspect.status) == (int(Flag.BEACON_OFF), (3, 0.09, True))
    for _ in range(3):
        suspect.check(None, False, "")
    assert (suspect.flags, suspect.status[0]) == (0, UNIDENTIFIED)
    assert [level for _, level in said] == [mailbox.WARN, mailbox.INFO]
    assert all("beacon 3" in line for line, _ in said)


def test_a_beacon_that_can_be_named_later_is_told_again() -> None:
    said: list[str] = []
    suspect = SuspectBeacon(lambda line, level: said.append(line))
    suspect.check(Offset(None, 0.07), False, "")
    assert suspect.status == (UNIDENTIFIED, 0.07, False)
    suspect.check(Offset(4, 0.07), False, "3 would be left")
    assert len(said) == 2
    assert "3 would be left" in said[1]
