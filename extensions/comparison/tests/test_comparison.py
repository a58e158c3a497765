"""Comparison of estimators: errors by hand, the same results as by direct calls, and bad input."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from bearing_sim import PAPER_BEACONS, BearingEmulator, BearingMeasurement, BearingParameters
from bearing_sim.beacons import PRESETS as LAYOUTS
from bearing_sim.beacons import parse_layout
from bearing_sim.observability import frame_bound
from estimation import registry
from estimation.parameters import EstimationParameters
from extensions.comparison.comparison import EstimatorComparison
from extensions.comparison.results import message_of
from quadrotor.plain_rotations import quaternion_of
from quadrotor.records import BEARINGS_SAMPLE, ESTIMATE, TICK, Record, new_state
from vehicle_link.messages import decode, encode

MS = 1_000_000
START_NS = 7_000_000_000
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
RADIUS, SPIN = 0.8, 1.0
"""m, rad/s: a level vehicle that slides around the centre of the beacons, 1 m high."""
PACKET = 5


def place(stamp_ns: int) -> np.ndarray:
    angle = SPIN * 1e-9 * (stamp_ns - START_NS)
    return np.array([RADIUS * math.cos(angle), RADIUS * math.sin(angle), 1.0])


def ticks_of(first_ns: int, count: int = PACKET, drift: float = 0.0) -> Record:
    """Return ticks of the slide at 500 Hz; the vehicle's estimate is `drift` m too high."""
    ticks = np.zeros(count, TICK)
    stamps = first_ns + 2 * MS * np.arange(count)
    ticks["imu"]["stamp_ns"] = stamps
    for k, stamp_ns in enumerate(stamps.tolist()):
        x, y, z = place(stamp_ns)
        ticks["imu"]["specific_force_b"][k] = -(SPIN**2) * x, -(SPIN**2) * y, 9.81
        ticks["state"]["position_w"][k] = x, y, z + drift
        ticks["state"]["velocity_w"][k] = -SPIN * y, SPIN * x, 0.0
        ticks["state"]["quaternion_wb"][k] = LEVEL
    return ticks


@dataclass
class Flight:
    """Packets, true poses every 10 ms and frames of bearings, to be fed in any order."""

    seconds: float
    start_ns: int = START_NS
    settings: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        emulator = BearingEmulator(BearingParameters(**self.settings))
        self.packets: list[Record] = []
        self.frames: list[list[BearingMeasurement]] = []  # those received by each packet
        for k in range(round(self.seconds * 100)):
            packet = ticks_of(self.start_ns + 10 * MS * k)
            self.packets.append(packet)
            now_ns = int(packet["imu"]["stamp_ns"][-1])
            emulator.observe(now_ns, place(now_ns), LEVEL)
            self.frames.append(emulator.due(now_ns))

    def feed(self, comparison: EstimatorComparison, first: int = 0, last: int = 1 << 30) -> None:
        for packet, frames in list(zip(self.packets, self.frames, strict=True))[first:last]:
            now_ns = int(packet["imu"]["stamp_ns"][-1])
            comparison.truth(now_ns, place(now_ns), LEVEL)
            for frame in frames:
                comparison.bearings(frame, frame.beacons or PAPER_BEACONS)
            comparison.ticks(packet)

    def all_frames(self) -> list[BearingMeasurement]:
        return [frame for frames in self.frames for frame in frames]


def begun(*words: str) -> EstimatorComparison:
    comparison = EstimatorComparison()
    comparison.choose(words)
    for word in words:
        comparison.start(word, registry.create(word, EstimationParameters()))
    return comparison


def newest(comparison: EstimatorComparison) -> Any:
    """Return the report as a page gets it."""
    report = comparison.report()
    assert report is not None
    message = message_of(report)
    return decode(encode(message), "quadlab_msgs/EstimatorComparison")


def state_of(comparison: EstimatorComparison, word: str) -> Record:
    return comparison._shadows[word].state.copy()


# ---------------------------------------------------------------------- the vehicle's own
def test_errors_of_a_still_vehicle_are_those_worked_out_by_hand() -> None:
    comparison = begun()
    turned = np.array(quaternion_of(0.0, 0.0, 0.02))
    for k in range(100):
        stamp_ns = START_NS + 10 * MS * k
        ticks = np.zeros(PACKET, TICK)
        ticks["imu"]["stamp_ns"] = stamp_ns + 2 * MS * np.arange(1 - PACKET, 1)
        high = k >= 50
        ticks["state"]["position_w"] = (0.3, 0.0, 1.4) if high else (0.0, 0.0, 1.0)
        ticks["state"]["quaternion_wb"] = turned
        comparison.truth(stamp_ns, np.array([0.0, 0.0, 1.0]), LEVEL)
        comparison.ticks(ticks)
    message = newest(comparison)
    [own] = message.estimators
    assert own.name == "vehicle"
    assert own.initialized
    assert own.converged
    assert message.truth == "truth"
    assert own.position_error == pytest.approx(0.5)  # from 0.3 and 0.4
    assert own.attitude_error == pytest.approx(0.02)
    assert own.position_rms == pytest.approx(0.5 * math.sqrt(0.5))  # half of them 0, half 0.5
    assert own.position_max == pytest.approx(0.5)
    assert own.position_rms_recent == pytest.approx(own.position_rms)
    assert own.attitude_rms == pytest.approx(0.02)
    assert own.attitude_max_recent == pytest.approx(0.02)
    assert message.duration == pytest.approx(0.99)
    assert math.isnan(own.processor)
    assert np.isnan(own.position_covariance).all()
    assert math.isnan(message.sigma)  # no frame has arrived
    position = own.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((0.3, 0.0, 1.4))


def test_the_truth_is_interpolated_at_the_stamps_of_the_estimates() -> None:
    comparison = begun()
    for k in range(50):
        truth_ns = START_NS + 10 * MS * k + 3 * MS  # between the stamps of the ticks
        comparison.truth(truth_ns, place(truth_ns), LEVEL)
        comparison.ticks(ticks_of(START_NS + 10 * MS * k))
    [own] = newest(comparison).estimators
    assert own.position_error < 1e-6  # 4 mm in the 5 ms between
    assert own.position_max < 1e-4  # the first two are joined by a straight line


@pytest.mark.parametrize("late", [-20, 20])
def test_truth_and_telemetry_may_come_one_after_the_other(late: int) -> None:
    comparison = begun()
    for k in range(200):
        if k >= -late:
            stamp_ns = START_NS + 10 * MS * (k + late) + 4 * MS
            comparison.truth(stamp_ns, place(stamp_ns), LEVEL)
        comparison.ticks(ticks_of(START_NS + 10 * MS * k, drift=0.1))
    [own] = newest(comparison).estimators
    assert own.position_rms == pytest.approx(0.1, abs=1e-4)


def test_residuals_are_the_angles_between_measured_and_expected_bearings() -> None:
    comparison = begun()
    stamp_ns = START_NS + 1000 * MS + 4 * MS
    for k in range(120):
        packet = ticks_of(START_NS + 10 * MS * k)
        now_ns = int(packet["imu"]["stamp_ns"][-1])
        comparison.truth(now_ns, place(now_ns), LEVEL)
        comparison.ticks(packet)
    here = place(stamp_ns)
    away = PAPER_BEACONS.positions_w - here
    away /= np.linalg.norm(away, axis=1)[:, None]
    angle = 0.03  # the second is turned by this about the axis across z
    axis = np.cross(away[1], [0.0, 0.0, 1.0])
    axis /= np.linalg.norm(axis)
    away[1] = math.cos(angle) * away[1] + math.sin(angle) * np.cross(axis, away[1])
    ids = np.array([1, 2, 77, 4], np.int32)  # no beacon has the id 77
    comparison.bearings(BearingMeasurement(stamp_ns, ids, away, 0.02), PAPER_BEACONS)
    message = newest(comparison)
    [own] = message.estimators
    assert own.beacon_ids.tolist() == [1, 2, 4]
    assert own.residuals == pytest.approx([0.0, angle, 0.0], abs=2e-5)
    assert message.sigma == 0.02
    expected = frame_bound(place(0), np.eye(3), PAPER_BEACONS.positions_w[[0, 1, 3]], 0.02)
    assert math.isnan(expected[0])  # three beacons determine no pose
    assert math.isnan(message.position_bound)


def test_residuals_belong_to_the_instant_of_the_frame_between_two_packets() -> None:
    comparison = begun()
    instant_ns = START_NS + 500 * MS + 1 * MS  # 7 ms after one packet's end, 3 ms before the next
    away = PAPER_BEACONS.positions_w - place(instant_ns)
    away /= np.linalg.norm(away, axis=1)[:, None]
    frame = BearingMeasurement(instant_ns, PAPER_BEACONS.ids, away, 0.02)
    for k in range(53):
        if k == 49:
            comparison.bearings(frame, PAPER_BEACONS)  # before the telemetry of its instant
            comparison.report()
        comparison.ticks(ticks_of(START_NS + 10 * MS * k))
    [own] = newest(comparison).estimators
    assert own.residuals == pytest.approx([0.0] * 4, abs=5e-5)  # 3 ms unaccounted for: 2e-3


def test_the_bound_is_that_of_the_beacons_seen_at_the_true_pose() -> None:
    comparison = begun()
    Flight(1.0).feed(comparison)
    message = newest(comparison)
    true = place(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
    position, attitude = frame_bound(true, np.eye(3), PAPER_BEACONS.positions_w, math.radians(1.5))
    assert message.position_bound == pytest.approx(position, rel=1e-3)
    assert message.attitude_bound == pytest.approx(attitude, rel=1e-3)


def test_the_trackers_poses_are_the_truth_where_there_is_no_better() -> None:
    comparison = begun()

    def seconds(first: int, last: int, *sources: Any) -> Any:
        for k in range(first, last):
            packet = ticks_of(START_NS + 10 * MS * k, drift=0.1)
            now_ns = int(packet["imu"]["stamp_ns"][-1])
            if "tracker" in sources:
                comparison.tracker(now_ns, place(now_ns) + np.array([0.0, 0.0, 0.1]), LEVEL)
            if "truth" in sources:
                comparison.truth(now_ns, place(now_ns), LEVEL)
            comparison.ticks(packet)
        message = newest(comparison)
        return message.truth, round(message.estimators[0].position_error, 4)

    assert seconds(0, 100, "tracker") == ("tracker", 0.0)
    assert seconds(100, 200, "tracker", "truth") == ("truth", 0.1)
    assert seconds(200, 400, "tracker") == ("tracker", 0.0)
    source, error = seconds(400, 500)
    assert source == ""
    assert math.isnan(error)


def test_nothing_is_told_twice_or_without_telemetry() -> None:
    comparison = begun()
    assert comparison.report() is None
    comparison.truth(START_NS, place(START_NS), LEVEL)
    assert comparison.report() is None
    Flight(0.1).feed(comparison)
    assert comparison.report() is not None
    assert comparison.report() is None


# ---------------------------------------------------------------------- estimators in the shadow
def direct(word: str, flight: Flight, since: int = 0) -> tuple[Any, Record]:
    """Return the estimator after the flight, called as in the vehicle's tick."""
    estimator = registry.create(word, EstimationParameters())
    state, estimate = new_state(), np.zeros(1, ESTIMATE)
    samples = np.concatenate(flight.packets[since:])["imu"].copy()
    last_ns = int(samples["stamp_ns"][0]) - 2 * MS
    frames = flight.all_frames()
    for k, stamp_ns in enumerate(samples["stamp_ns"].tolist()):
        estimator.predict(samples[k : k + 1], 1e-9 * (stamp_ns - last_ns), state)
        last_ns = stamp_ns
        while frames and frames[0].stamp_ns <= stamp_ns:
            frame, record = frames.pop(0), np.zeros(1, BEARINGS_SAMPLE)
            count = len(frame.beacon_ids)
            record["stamp_ns"], record["count"] = frame.stamp_ns, count
            record["sigma"] = frame.sigma
            beacons = frame.beacons or PAPER_BEACONS
            order = [beacons.ids.tolist().index(one) for one in frame.beacon_ids.tolist()]
            record["beacon_w"][0, :count] = beacons.positions_w[order]
            record["bearing_b"][0, :count] = frame.bearings_b
            estimator.correct_bearings(record, estimate)
    return estimator, state


@pytest.mark.parametrize("word", ["error_state", "complementary"])
def test_an_estimator_in_the_shadow_gives_what_it_gives_when_called_directly(word: str) -> None:
    flight = Flight(4.0)
    comparison = begun(word)
    flight.feed(comparison)
    estimator, state = direct(word, flight)
    assert state_of(comparison, word).tobytes() == state.tobytes()
    other = newest(comparison).estimators[1]
    assert other.name == word
    assert other.initialized
    assert other.converged == estimator.converged
    error = np.linalg.norm(
        state["position_w"][0] - place(flight.packets[-1]["imu"]["stamp_ns"][-1])
    )
    assert other.position_error == pytest.approx(error, abs=1e-9)
    assert other.processor > 0.0
    if word == "error_state":
        np.testing.assert_array_equal(
            other.position_covariance, estimator.covariance[:3, :3].ravel()
        )
        assert other.attitude_variance == pytest.approx(estimator.deviations.attitude**2)
        assert 0.0 < other.position_rms_recent < 0.1
    else:
        assert np.isnan(other.position_covariance).all()


def test_frames_that_come_before_their_telemetry_wait_in_order() -> None:
    flight = Flight(3.0)
    early = begun("error_state")
    frames = flight.all_frames()
    for k, packet in enumerate(flight.packets):
        if k % 20 == 0:  # all of the next 0.2 s, the last first
            end_ns = int(packet["imu"]["stamp_ns"][-1]) + 200 * MS
            coming = [frame for frame in frames if frame.stamp_ns <= end_ns]
            del frames[: len(coming)]
            for frame in reversed(coming):
                early.bearings(frame, PAPER_BEACONS)
        early.ticks(packet)
    usual = begun("error_state")
    flight.feed(usual)
    assert state_of(early, "error_state").tobytes() == state_of(usual, "error_state").tobytes()


def test_late_frames_act_at_their_own_instant() -> None:
    prompt, late = begun("error_state"), begun("error_state")
    Flight(4.0).feed(prompt)
    Flight(4.0, settings={"delay": 0.3}).feed(late)
    apart = (
        state_of(prompt, "error_state")["position_w"] - state_of(late, "error_state")["position_w"]
    )
    assert 0.0 < np.linalg.norm(apart) < 0.05  # 0.3 s of the way are 0.24 m


def test_lost_and_reordered_packets_are_lived_with(capsys: pytest.CaptureFixture[str]) -> None:
    seed = 11
    print("seed", seed)
    random = np.random.default_rng(seed)
    flight, comparison = Flight(8.0), begun("error_state", "complementary")
    order = np.argsort(np.arange(len(flight.packets)) + random.uniform(0, 1.5, len(flight.packets)))
    for k in order.tolist():
        packet = flight.packets[k]
        now_ns = int(packet["imu"]["stamp_ns"][-1])
        comparison.truth(now_ns, place(now_ns), LEVEL)
        for frame in flight.frames[k]:
            comparison.bearings(frame, PAPER_BEACONS)
        if random.uniform() > 0.1:
            comparison.ticks(packet)
    for one in newest(comparison).estimators[1:]:
        assert one.initialized
        assert one.position_rms_recent < 0.12
        assert one.position_error < 0.06


def test_a_hole_of_a_fifth_of_a_second_is_bridged_and_a_long_one_starts_anew() -> None:
    flight, comparison = Flight(6.0), begun("error_state")
    flight.feed(comparison, 0, 300)
    estimator: Any = comparison._shadows["error_state"].estimator
    applied = estimator.memory["applied"]
    before = int(applied[0])
    assert before > 80
    flight.feed(comparison, 320, 330)
    assert applied[0] > before
    error = (
        state_of(comparison, "error_state")["position_w"][0]
        - flight.packets[329]["state"]["position_w"][-1]
    )
    assert np.linalg.norm(error) < 0.05
    flight.feed(comparison, 430, 431)
    assert applied[0] <= 1  # none except that packet's frame
    flight.feed(comparison, 431, 600)
    again = newest(comparison).estimators[1]
    assert again.initialized
    assert again.position_error < 0.06


def test_a_vehicle_that_is_started_again_begins_everything_anew() -> None:
    comparison = begun("error_state")
    Flight(3.0, start_ns=START_NS + 100_000 * MS).feed(comparison)
    assert newest(comparison).duration == pytest.approx(2.99)
    later = Flight(3.0)
    later.feed(comparison)
    message = newest(comparison)
    assert message.header.stamp.sec == 9  # 7 + 3
    own, other = message.estimators
    assert own.position_max < 1e-6
    assert 2.5 < message.duration < 3.0
    assert other.initialized
    assert other.position_error < 0.06


def test_one_packet_that_was_under_way_for_long_is_passed_over() -> None:
    flight, comparison = Flight(4.0), begun("error_state")
    flight.feed(comparison, 0, 300)
    comparison.ticks(flight.packets[20])
    comparison.ticks(flight.packets[21])
    flight.feed(comparison, 300, 400)
    undisturbed = begun("error_state")
    flight.feed(undisturbed)
    assert (
        state_of(comparison, "error_state").tobytes()
        == state_of(undisturbed, "error_state").tobytes()
    )


def test_each_frame_is_solved_with_the_beacons_of_its_own_instant() -> None:
    comparison = begun("error_state")
    parameters = BearingParameters(delay=0.3)
    emulator = BearingEmulator(parameters)
    for k in range(600):
        packet = ticks_of(START_NS + 10 * MS * k)
        now_ns = int(packet["imu"]["stamp_ns"][-1])
        if k == 300:
            parameters.layout = "ceiling"  # the same ids elsewhere; 0.3 s of frames in transit
        emulator.observe(now_ns, place(now_ns), LEVEL)
        for frame in emulator.due(now_ns):
            assert frame.beacons is not None
            assert (
                frame.beacons
                == LAYOUTS["ceiling" if frame.stamp_ns > START_NS + 2998 * MS else "paper"]
            )
            comparison.bearings(frame, frame.beacons)
        comparison.truth(now_ns, place(now_ns), LEVEL)
        comparison.ticks(packet)
    estimator: Any = comparison._shadows["error_state"].estimator
    assert not estimator.ignored
    other = newest(comparison).estimators[1]
    assert other.position_error < 0.08
    assert max(other.residuals) < math.radians(8)


def test_changing_the_set_leaves_the_others_as_they_are() -> None:
    flight, comparison, alone = Flight(4.0), begun("error_state"), begun("error_state")
    flight.feed(alone)
    flight.feed(comparison, 0, 200)
    comparison.choose(["complementary", "error_state"])
    comparison.start("complementary", registry.create("complementary", EstimationParameters()))
    flight.feed(comparison, 200, 300)
    message = newest(comparison)
    assert [one.name for one in message.estimators] == ["vehicle", "complementary", "error_state"]
    comparison.choose(["error_state"])
    flight.feed(comparison, 300, 400)
    assert state_of(comparison, "error_state").tobytes() == state_of(alone, "error_state").tobytes()
    ours, theirs = newest(comparison).estimators[1], newest(alone).estimators[1]
    assert ours.position_rms == theirs.position_rms


def test_an_estimator_that_is_still_being_compiled_is_shown_without_a_start() -> None:
    comparison = EstimatorComparison()
    comparison.choose(["error_state"])
    Flight(0.5).feed(comparison)
    waiting = newest(comparison).estimators[1]
    assert not waiting.initialized
    assert not waiting.converged
    assert math.isnan(waiting.position_error)
    assert math.isnan(waiting.pose.position.x)
    assert len(waiting.residuals) == 0


def test_a_frame_of_two_beacons_starts_nothing_and_complains_of_nothing_else() -> None:
    comparison = begun("error_state")
    Flight(1.0, settings={"lost": "1 2"}).feed(comparison)
    message = newest(comparison)
    assert not message.estimators[1].initialized
    assert message.estimators[0].beacon_ids.tolist() == [3, 4]
    assert math.isnan(message.position_bound)
    assert "beacon" in comparison._shadows["error_state"].complaint


def test_a_frame_without_bearings_is_told_as_such() -> None:
    comparison = begun("error_state")
    Flight(1.0, settings={"lost": "all"}).feed(comparison)
    message = newest(comparison)
    assert len(message.estimators[0].beacon_ids) == 0
    assert not message.estimators[1].initialized


def test_an_estimator_with_a_defect_is_stopped_and_the_rest_goes_on() -> None:
    said: list[str] = []
    comparison = EstimatorComparison(said.append)
    comparison.choose(["broken", "error_state"])

    class Broken:
        initialized = False

        def predict(self, *arguments: Any) -> None:
            raise ZeroDivisionError("oh")

    comparison.start("broken", Broken())  # type: ignore[arg-type]
    comparison.start("error_state", registry.create("error_state", EstimationParameters()))
    Flight(2.0).feed(comparison)
    assert said == ["comparing broken stopped: ZeroDivisionError: oh"]
    broken, other = newest(comparison).estimators[1:]
    assert not broken.initialized
    assert other.initialized


def test_a_gyroscope_calibrated_anew_starts_the_estimators_anew() -> None:
    flight, comparison = Flight(2.0), begun("error_state")
    comparison.status(armed=False, starting=True)
    flight.feed(comparison, 0, 100)
    comparison.status(armed=False, starting=False)
    assert not comparison._shadows["error_state"].initialized
    flight.feed(comparison, 100, 200)
    assert comparison._shadows["error_state"].initialized


def test_the_layout_may_be_given_in_numbers() -> None:
    beacons = parse_layout("9 2 0 0; 8 0 2 0; 7 -2 0 0; 6 0 -2 0")
    comparison = begun("error_state")
    flight = Flight(2.0, settings={"layout": "9 2 0 0; 8 0 2 0; 7 -2 0 0; 6 0 -2 0"})
    assert flight.all_frames()[0].beacons == beacons
    flight.feed(comparison)
    other = newest(comparison).estimators[1]
    assert other.beacon_ids.tolist() == [9, 8, 7, 6]
    assert other.position_error < 0.1
