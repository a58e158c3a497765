"""Each fault of the simulated tracker, by the values of its poses."""

from __future__ import annotations

import numpy as np
import pytest

from bearing_sim import PoseMeasurement, SimulatedTracker, TrackerParameters
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import Array, matrix_of, quaternion_of

MS = 1_000_000
TURNED = np.array(quaternion_of(0.3, -0.2, 0.5))
FAR_AWAY = "tracker.freeze from=1000"


def place(k: int) -> Array:
    return np.array([0.3 + 0.001 * k, -0.2, 1.1])


def poses(faults: str, seconds: float = 1.0, **values: float) -> list[PoseMeasurement]:
    """Return the poses in order of arrival, of a body that moves by 0.1 m/s, at 100 Hz."""
    parameters = TrackerParameters(position_noise=0.0, attitude_noise=0.0)
    ParameterStore(parameters).preset({**values, "faults": faults})
    tracker = SimulatedTracker(parameters)
    for k in range(round(100 * seconds)):
        tracker.observe(10 * MS * k, place(k), TURNED)
    return tracker.due(10**12)


def same(one: PoseMeasurement, other: PoseMeasurement) -> bool:
    return one.stamp_ns == other.stamp_ns and all(
        np.array_equal(a, b) for a, b in zip(one[1:], other[1:], strict=True)
    )


NOISY = {"position_noise": 0.01, "attitude_noise": 1.0, "drop_out": 0.2, "outliers": 0.1}


def test_without_a_fault_that_is_on_nothing_changes_to_the_bit() -> None:
    plain, later = poses("", **NOISY), poses(FAR_AWAY, **NOISY)
    assert len(plain) == len(later)
    assert all(map(same, plain, later))


@pytest.mark.parametrize("what", ["pose", "position", "attitude"])
def test_a_frozen_pose_stays_to_the_bit_from_its_beginning_until_before_its_end(what: str) -> None:
    noise = {"position_noise": 0.01, "attitude_noise": 1.0}
    plain = poses("", **noise)
    frozen = poses(f"tracker.freeze what={what} from=0.3 to=0.6", **noise)
    for k, (was, now) in enumerate(zip(plain, frozen, strict=True)):
        held = plain[30] if 30 <= k < 60 else was
        assert now.stamp_ns == was.stamp_ns
        position = held if what != "attitude" else was
        attitude = held if what != "position" else was
        np.testing.assert_array_equal(now.position_w, position.position_w)
        np.testing.assert_array_equal(now.quaternion_wb, attitude.quaternion_wb)


def test_a_drift_moves_by_its_speed() -> None:
    drifting = poses("tracker.drift x=0.1 z=-0.05 from=0.2")
    for k, one in enumerate(drifting):
        t = max(0.0, 0.01 * k - 0.2)
        np.testing.assert_allclose(
            one.position_w, np.add(place(k), (0.1 * t, 0, -0.05 * t)), atol=1e-12
        )


def test_a_tilt_turns_the_world_and_keeps_the_angles_of_the_body_to_it() -> None:
    matrix = matrix_of(np.array(quaternion_of(np.radians(10.0), 0.0, np.radians(30.0))))
    one = poses("tracker.tilt x=10 z=30")[0]
    np.testing.assert_allclose(one.position_w, matrix @ place(0), atol=1e-12)
    np.testing.assert_allclose(matrix_of(one.quaternion_wb), matrix @ matrix_of(TURNED), atol=1e-12)


def test_a_scale_multiplies_positions_and_ramps_up() -> None:
    scaled = poses("tracker.scale factor=1.1 ramp=0.5")
    np.testing.assert_allclose(scaled[25].position_w, 1.05 * place(25), rtol=1e-12)
    np.testing.assert_allclose(scaled[80].position_w, 1.1 * place(80), rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_other_handedness_is_a_reflection(axis: int) -> None:
    mirror = np.eye(3)
    mirror[axis, axis] = -1.0
    one = poses(f"tracker.handedness axis={'xyz'[axis]}")[0]
    np.testing.assert_array_equal(one.position_w, mirror @ place(0))
    np.testing.assert_allclose(
        matrix_of(one.quaternion_wb), mirror @ matrix_of(TURNED) @ mirror, atol=1e-12
    )


def test_flipped_axes_are_the_same_pose_in_other_axes() -> None:
    to_y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    true = matrix_of(TURNED)
    for which, position, rotation in (
        ("y_up", to_y_up @ place(0), to_y_up @ true @ to_y_up.T),
        ("world_quarter", quarter @ place(0), quarter @ true),
        ("body_quarter", place(0), true @ quarter),
    ):
        one = poses(f"tracker.axes which={which}")[0]
        np.testing.assert_allclose(one.position_w, position, atol=1e-12)
        np.testing.assert_allclose(matrix_of(one.quaternion_wb), rotation, atol=1e-12)


def test_a_swapped_body_is_the_other_one_while_it_lasts() -> None:
    swapped = poses("tracker.swapped_bodies x=1 y=2 z=0.5 from=0.1 to=0.2")
    for k, one in enumerate(swapped):
        expected = (1.0, 2.0, 0.5) if 10 <= k < 20 else place(k)
        np.testing.assert_array_equal(one.position_w, expected)
    np.testing.assert_array_equal(swapped[15].quaternion_wb, (1.0, 0.0, 0.0, 0.0))


def test_a_clock_steps_and_drifts() -> None:
    late = poses("tracker.clock step=0.2 drift=1000 from=0.5")
    assert [one.stamp_ns for one in late[:50]] == [10 * MS * k for k in range(50)]
    assert late[50].stamp_ns == 700 * MS
    assert late[90].stamp_ns == 900 * MS + 200 * MS + 400_000


def test_duplicates_and_the_wrong_order_come_as_declared() -> None:
    stamps = [one.stamp_ns // (10 * MS) for one in poses("tracker.duplicates copies=3 to=0.02")]
    assert stamps == [0, 0, 0, 1, 1, 1, *range(2, 100)]
    stamps = [one.stamp_ns // (10 * MS) for one in poses("tracker.order from=0.1 to=0.15")]
    # 14 is held back when the fault ends, and lost.
    assert stamps == [*range(10), 11, 10, 13, 12, *range(15, 100)]


def test_a_delay_grows_and_a_rate_falls_as_parameters_on_a_schedule() -> None:
    tracker = SimulatedTracker(TrackerParameters(faults="tracker.delay value=0.1 ramp=1"))
    for k in range(100):
        tracker.observe(10 * MS * k, place(k), TURNED)
    arrivals = []
    while (arrival_ns := tracker.next_ns) is not None:
        arrivals += [(arrival_ns, one.stamp_ns) for one in tracker.due(arrival_ns)]
    assert arrivals == [(11 * MS * k, 10 * MS * k) for k in range(100)]
    slow = poses("tracker.rate value=20 from=0.5")
    assert [one.stamp_ns for one in slow[:50]] == [10 * MS * k for k in range(50)]
    assert len(slow) == pytest.approx(60, abs=1)


def test_several_faults_act_at_once_in_the_order_of_the_text() -> None:
    one = poses("tracker.drift x=1; tracker.scale factor=2")[50]
    np.testing.assert_allclose(one.position_w, 2.0 * np.add(place(50), (0.5, 0, 0)), rtol=1e-12)


def test_random_faults_are_the_same_for_a_seed() -> None:
    text = "tracker.swapped_bodies share=0.3 spell=0.05"
    runs = [[one.position_w[0] == 1.5 for one in poses(text, 10.0, seed=s)] for s in (3, 3, 4)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]
    assert np.mean(runs[0]) == pytest.approx(0.3, abs=0.02)
