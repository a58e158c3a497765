"""`quadlab replay`: the flight again byte for byte, other estimators on it, and wrong arguments."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bearing_sim.beacons import parse_layout
from estimation import names, registry
from estimation.complementary import ComplementaryEstimator
from extensions.offline.lines import flown_choices, plan_runs
from extensions.offline.measurements import MeasurementStore, emulated
from extensions.offline.run import replay
from flight_log import LogWriter, read_attachments, read_log
from quadlab.__main__ import main
from quadlab.recording import log as log_module
from quadlab.recording.errors import Truth, angles, errors
from quadlab.recording.log import Recording, read_recording
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import LogFormatError, MeasurementError
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import rotate
from quadrotor.records import STATE
from vehicle.flight.kernels import prepare
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.topics.ticks import odometry_messages

ON_BEARINGS = 9.0
"""Duration of the flight on bearings, s."""
TIMED = {"processor_s_per_s"}


def flown(path: Path, handed_over: bool, marker: bool = False) -> Path:
    """Fly shortly on the tracker, on a marker, or on bearings; write the log.

    Measurements are late, and gains are changed in flight.
    """
    parameters = FlightParameters().model_copy(deep=True)
    parameters.seed(7)
    parameters.tracker.delay, parameters.bearings.delay = 0.012, 0.0155
    parameters.tracker.positions_only = marker
    parameters.estimation.estimator = "error_state" if marker else "complementary"
    simulated = SimulatedVehicle(parameters.simulator)
    simulated.warm_up()
    prepare(lambda line: None)
    registry.prepare("error_state", bearings=True)
    log = FlightLog(path, "quad1", ParameterStore(parameters), {"run_id": path.stem})
    flight = SimulatedFlight(parameters, simulated, log)
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
    flight.wait(0.5)
    if handed_over:  # compiled only on the ground
        flight.change({"estimation.shadow": "error_state", "estimation.shadow_source": "bearings"})
    flight.arm()
    flight.wait(1.0)
    flight.start("take_off", height=1.0)
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)
    flight.wait(1.0)
    if handed_over:
        flight.change({"estimation.estimator": "error_state", "estimation.source": "bearings"})
    flight.wait(0.7)
    flight.change({"estimation.position_bandwidth": 6.0, "estimation.error_state.gate": 5.0})
    flight.wait(ON_BEARINGS - 0.7 if handed_over else 1.0)
    if handed_over:
        flight.change({"estimation.source": "poses"})
    flight.start("land")
    flight.wait_until(lambda v: not v.armed, what="touch-down", timeout=20)
    log.close()
    return path


@pytest.fixture(scope="session")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown(tmp_path_factory.mktemp("replay") / "tracker.mcap", handed_over=False)


def test_a_recording_is_held_up_to_a_bound(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    count = len(read_recording(log).imu)
    monkeypatch.setattr(log_module, "MAX_SAMPLES", count - 1)
    with pytest.raises(LogFormatError, match=rf"{count} .* cut it .*--include-attachments"):
        read_recording(log)


@pytest.fixture(scope="session")
def recording(log: Path) -> Recording:
    return read_recording(log)


@pytest.fixture(autouse=True)
def _read_once(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read the common log once, in the first test that needs it; replays do not change it."""
    if "log" in request.fixturenames:
        log, recording = request.getfixturevalue("log"), request.getfixturevalue("recording")
        monkeypatch.setattr(
            "quadlab.recording.log.read_recording",
            lambda path: recording if path == log else read_recording(path),
        )


@pytest.fixture
def truth(recording: Recording) -> Truth:
    return Truth(recording.truth_ns, recording.truth)


def without(log: Path, to: Path, left_out: Collection[str]) -> Path:
    """Write the log without some topics."""
    writer = LogWriter(to, {"run_id": to.stem}, read_attachments(log))
    for message in read_log(log):
        if message.topic.rpartition("/")[2] not in left_out:
            writer.write(
                message.topic,
                message.type_name,
                message.payload,
                message.log_ns,
                message.publish_ns,
            )
    writer.close()
    return to


def table(
    capsys: pytest.CaptureFixture[str], log: Path, *words: str
) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """Return rows by label, and the whole report."""
    assert main(["replay", str(log), *words, "--json"]) == 0
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    return {row["run"]: row for row in report["runs"]}, report


def as_flown(recording: Recording, truth: Truth) -> list[bool]:
    """Return whether each replayed state is the message in the log, byte for byte."""
    [run] = plan_runs(recording, (), (), (), None)
    replayed = replay(recording, run, MeasurementStore(recording, truth).of(run))
    again = payloads_of(odometry_messages(recording.imu["stamp_ns"], replayed.states))
    logged = [message.payload for message in read_log(recording.path, {"/quad1/state"})]
    return [one == other for one, other in zip(again, logged, strict=True)]


# ---------------------------------------------------------------------- the same flight again
def test_the_flight_is_replayed_byte_for_byte(recording: Recording, truth: Truth) -> None:
    assert any(c.name == "estimation.position_bandwidth" for c in recording.changes)
    same = as_flown(recording, truth)
    assert len(same) > 3000
    assert all(same), f"first differs sample {same.index(False)} of {len(same)}"


def test_a_flight_on_a_marker_is_replayed_byte_for_byte(tmp_path: Path) -> None:
    recording = read_recording(flown(tmp_path / "marker.mcap", handed_over=False, marker=True))
    assert len(recording.poses) > 700
    assert len(recording.armed) == 1
    assert all(as_flown(recording, Truth(recording.truth_ns, recording.truth)))


def test_a_flight_handed_over_to_bearings_is_replayed_byte_for_byte(tmp_path: Path) -> None:
    recording = read_recording(flown(tmp_path / "bearings.mcap", handed_over=True))
    bearings, poses = flown_choices(recording)
    assert (bearings.estimator, bearings.source) == ("error_state", "bearings")
    assert (poses.estimator, poses.source) == ("complementary", "poses")
    assert bearings.seconds == pytest.approx(ON_BEARINGS, abs=0.02)
    same = np.array(as_flown(recording, Truth(recording.truth_ns, recording.truth)))
    [begin_ns] = [
        change.stamp_ns
        for change in recording.changes
        if (change.name, change.value) == ("estimation.source", "bearings")
    ]
    stamps = recording.imu["stamp_ns"]
    on_bearings = (stamps > begin_ns) & (stamps <= begin_ns + int(1e9 * ON_BEARINGS))
    assert on_bearings.sum() == ON_BEARINGS * 500
    assert same[on_bearings].all()
    assert not same[~on_bearings].all()


def test_noise_of_the_same_seed_makes_the_recorded_measurements(
    recording: Recording, truth: Truth
) -> None:
    samples_ns = recording.imu["stamp_ns"]
    frames = emulated(recording.parameters.bearings, truth, samples_ns)
    assert len(frames) == len(recording.bearings) > 100
    for made, recorded in zip(frames, recording.bearings, strict=True):
        assert made.arrival_ns == recorded.arrival_ns
        assert made.measurement.tobytes() == recorded.measurement.tobytes()
    poses = emulated(recording.parameters.tracker, truth, samples_ns)
    assert [(ns, pose.tobytes()) for ns, pose in poses] == [
        (ns, pose.tobytes()) for ns, pose in recording.poses
    ]


def test_the_recorded_state_and_the_flown_estimator_have_the_same_errors(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    rows, report = table(capsys, log)
    flown, again = rows["recorded state"], rows["complementary, as flown"]
    assert again["on"] == "recorded poses"
    for name in ("position_rms_m", "position_max_m", "attitude_rms_deg", "velocity_max_m_s"):
        assert again[name] == pytest.approx(flown[name], rel=1e-12)
    assert report["window"]["found"] == "airborne by the vehicle's status"


def test_the_same_words_give_the_same_table(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    words = ["--run", "error_state bearings.sigma=2", "--estimator", "complementary"]
    words += ["--set", "estimation.preset=resolved"]
    first, second = (table(capsys, log, *words)[0] for _ in range(2))
    assert list(first) == ["recorded state", "complementary", "error_state bearings.sigma=2"]
    for label, row in first.items():
        for name in row.keys() - TIMED:
            assert row[name] == second[label][name]
    other, _ = table(capsys, log, "--run", "error_state bearings.sigma=2 bearings.seed=99")
    [label] = other.keys() - {"recorded state"}
    sigma = first["error_state bearings.sigma=2"]
    assert other[label]["position_rms_m"] != sigma["position_rms_m"]


# ---------------------------------------------------------------------- what runs find
def test_runs_tell_good_gains_from_bad_and_noise_from_little_noise(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    words = [
        "error_state",
        "error_state bearings.sigma=6",
        "complementary estimation.preset=paper",
        "complementary estimation.preset=resolved",
        "error_state estimation.source=poses",
    ]
    rows, _ = table(capsys, log, *(word for one in words for word in ("--run", one)))
    rms = {name: rows[name]["position_rms_m"] for name in words}
    assert rms["error_state"] < 0.03
    assert rms["error_state bearings.sigma=6"] > 1.5 * rms["error_state"]
    resolved = rms["complementary estimation.preset=resolved"]
    assert rms["complementary estimation.preset=paper"] > 2.0 * resolved
    assert rms["error_state estimation.source=poses"] < 0.2 * rms["error_state"]
    assert [rows[name]["on"] for name in words] == [
        "recorded bearings",
        "emulated bearings",
        *["recorded bearings"] * 2,
        "recorded poses",
    ]
    found, fixed = rows["error_state"], rows["complementary estimation.preset=paper"]
    assert found["nis_low"] < found["nis"] < found["nis_high"]
    assert found["nis_high"] - found["nis_low"] < 0.5
    assert found["nees_low"] == pytest.approx(0.300, abs=1e-3)  # chi-square of nine, over nine
    assert found["nees_high"] == pytest.approx(2.114, abs=1e-3)
    assert found["nees_inside_share"] > 0.8
    assert 0.3 < found["nees"] < 2.0
    assert all(fixed[name] is None for name in fixed if name.startswith(("nis", "nees")))
    assert all(rows[name]["rejected_share"] == 0.0 for name in words)


def test_a_filter_told_of_less_noise_than_there_is_shows_as_too_sure_and_corrects_itself(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    honest = "error_state estimation.source=poses"
    sure = f"{honest} estimation.error_state.pose_position_sigma=0.0002"
    rows, _ = table(capsys, log, "--run", sure, "--run", honest)
    assert rows[sure]["nis"] > 1.2 * rows[sure]["nis_high"] > rows[honest]["nis"]
    assert rows[sure]["nees"] > rows[sure]["nees_high"]
    # It is as good as the honest one, because it raised its noise.
    assert rows[sure]["nees_inside_share"] > 0.6
    assert rows[honest]["nees_inside_share"] > 0.6
    assert rows[sure]["position_rms_m"] < 1.1 * rows[honest]["position_rms_m"]


def test_of_the_trackers_poses_as_truth_the_pose_alone_is_judged(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    rows, _ = table(capsys, log, "--estimator", "error_state", "--truth", "tracker")
    assert rows["error_state"]["nees_low"] == pytest.approx(0.206, abs=1e-3)  # of six


def test_three_beacons_are_replayed_from_the_pose_that_was_flown_on(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    lost = "error_state bearings.lost=4"
    rows, _ = table(capsys, log, "--run", lost)
    assert rows[lost]["position_rms_m"] < 0.1
    assert rows[lost]["nees_inside_share"] > 0.5


def test_a_mistaken_map_of_the_beacons_shows(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    wrong = "error_state bearings.layout=wide beacons.layout=paper"
    rows, _ = table(capsys, log, "--run", "error_state bearings.layout=wide", "--run", wrong)
    assert rows["error_state bearings.layout=wide"]["position_rms_m"] < 0.05
    assert rows[wrong]["position_rms_m"] > 0.2


def test_a_survey_finds_where_the_beacons_are(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    believed = "beacons.layout=1 1.1 0.9 0.1; 2 -1 1 0.05; 3 -0.92 -1.1 0.1; 4 1 -1 0.2"
    words = ["--estimator", "error_state", "--on", "both", "--set", believed]
    assert main(["replay", str(log), *words, "--survey"]) == 0
    told = capsys.readouterr().out
    [line] = [line for line in told.splitlines() if "in use from here on" in line]
    found = parse_layout(line.partition("beacons.layout=")[2].rstrip("'"))
    off = found.positions_w - parse_layout("paper").positions_w
    assert np.abs(off).max() < 0.045  # 10 s of flight; the assumed places were up to 0.13 m off
    assert np.linalg.norm(off) < 0.4 * np.linalg.norm(
        parse_layout(believed.partition("=")[2]).positions_w - parse_layout("paper").positions_w
    )
    assert main(["replay", str(log), "--estimator", "complementary", "--survey"]) == 2
    assert "add --estimator error_state --on both" in capsys.readouterr().err


def test_beacons_of_a_file_are_those_of_the_layout(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    file = tmp_path / "beacons.csv"
    file.write_text("id,x,y,z\n1,2,2,0.1\n2,-2,2,0.1\n3,-2,-2,0.1\n4,2,-2,0.1\n")
    words = ["--estimator", "error_state"]
    from_file, _ = table(capsys, log, *words, "--beacons", str(file))
    by_name, _ = table(capsys, log, *words, "--set", "bearings.layout=wide")
    one, other = from_file["error_state"], by_name["error_state"]
    assert one["position_rms_m"] == other["position_rms_m"]
    file.write_text("id,x,y,z\n1,2,2\n")
    assert main(["replay", str(log), "--beacons", str(file)]) == 2
    assert "line 2, column" in capsys.readouterr().err


def test_late_and_lost_poses_are_made_anew(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    late = "complementary tracker.rate=20"
    rows, report = table(capsys, log, "--run", late, "--run", "complementary tracker.drop_out=0.5")
    assert rows[late]["on"] == "emulated poses"
    airborne = report["window"]["to_s"] - report["window"]["from_s"]
    assert rows[late]["measurements"] == pytest.approx(20 * airborne, abs=2)
    half = rows["complementary tracker.drop_out=0.5"]["measurements"]
    assert half == pytest.approx(50 * airborne, rel=0.2)


class Refusing(ComplementaryEstimator):
    """Estimator that refuses every second pose in flight."""

    count = 0

    def correct(self, pose: Any, estimate: Any) -> None:
        self.count += 1
        if self.count > 200 and self.count % 2:
            raise MeasurementError("not this one")
        super().correct(pose, estimate)


def test_an_estimator_of_ones_own_is_replayed_and_its_refusals_counted(
    capsys: pytest.CaptureFixture[str], log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(names.registered, "refusing", Refusing)
    rows, _ = table(capsys, log, "--estimator", "refusing", "--on", "poses")
    assert rows["refusing"]["rejected_share"] == pytest.approx(0.5, abs=0.01)
    assert rows["refusing"]["position_rms_m"] < 0.01


class Diverging(ComplementaryEstimator):
    """Estimator that is not finite after 3 s."""

    def predict(self, imu: Any, dt: float, state: Any) -> None:
        super().predict(imu, dt, state)
        if imu["stamp_ns"][0] > 3_000_000_000:
            state["position_w"] = np.nan


def test_an_estimate_that_is_not_finite_is_told_not_left_out(
    capsys: pytest.CaptureFixture[str], log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(names.registered, "diverging", Diverging)
    rows, _ = table(capsys, log, "--estimator", "diverging", "--on", "poses")
    assert rows["diverging"]["position_rms_m"] is None
    assert "estimates are not finite" in rows["diverging"]["note"]
    assert rows["diverging"]["attitude_rms_deg"] < 0.2


def test_a_run_without_a_measurement_says_that_it_never_started(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    words = ["replay", str(log), "--estimator", "error_state", "--set", "bearings.lost=all"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "error_state: never started: no measurement was received" in out


def test_a_window_is_what_was_asked_for(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    rows, report = table(capsys, log, "--from", "4", "--to", "5.5")
    assert report["window"] == {"from_s": 4.0, "to_s": 5.5, "found": "as given"}
    assert rows["complementary, as flown"]["measurements"] == pytest.approx(150, abs=1)


def test_without_a_status_the_height_says_what_was_airborne(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    _, whole = table(capsys, log)
    _, report = table(capsys, without(log, tmp_path / "a.mcap", {"status"}))
    assert report["window"]["found"] == "more than 0.05 m above the lowest point"
    assert report["window"]["from_s"] == pytest.approx(whole["window"]["from_s"], abs=0.5)


def test_the_tracker_may_stand_in_for_the_truth(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    real = without(log, tmp_path / "real.mcap", {"truth", "bearings", "bearing_pose"})
    rows, report = table(capsys, real, "--truth", "tracker", "--estimator", "error_state")
    assert report["truth"] == "tracker"
    assert rows["error_state"]["on"] == "emulated bearings"
    assert rows["error_state"]["position_rms_m"] < 0.03
    assert rows["error_state"]["velocity_rms_m_s"] is None


def test_table_csv_and_json_say_the_same(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    file = tmp_path / "table.csv"
    assert (
        main(["replay", str(log), "--estimator", "error_state", "--csv", str(file), "--json"]) == 0
    )
    lines = capsys.readouterr().out.splitlines()
    [row] = [one for one in json.loads(lines[-1])["runs"] if one["run"] == "error_state"]
    [told] = [one for one in csv.DictReader(file.open()) if one["run"] == "error_state"]
    assert float(told["position_rms_m"]) == row["position_rms_m"]
    [shown] = [line for line in lines if line.startswith("error_state")]
    assert f"{1e3 * row['position_rms_m']:.1f}" in shown.split()
    assert f"{row['attitude_max_deg']:.2f}" in shown.split()


def test_a_plot_is_drawn(capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path) -> None:
    file = tmp_path / "errors.png"
    words = ["--estimator", "error_state", "--estimator", "error_state", "--plot", str(file)]
    assert main(["replay", str(log), *words]) == 0
    assert file.read_bytes().startswith(b"\x89PNG")
    assert str(file) in capsys.readouterr().out


# ---------------------------------------------------------------------- errors against the truth
def moving(stamps: np.ndarray) -> np.ndarray:
    """Return STATE records of a motion of third order that turns evenly about a fixed axis."""
    t = stamps * 1e-9
    states = np.zeros(len(t), STATE)
    for axis, (a, b, c) in enumerate(((0.3, -0.2, 0.1), (1.0, 0.5, -0.4), (-0.7, 0.2, 0.3))):
        states["position_w"][:, axis] = a * t + b * t**2 + c * t**3
        states["velocity_w"][:, axis] = a + 2 * b * t + 3 * c * t**2
    turn = np.array((0.6, 0.0, 0.8))
    states["quaternion_wb"][:, 0] = np.cos(0.5 * 1.3 * t)
    states["quaternion_wb"][:, 1:] = np.sin(0.5 * 1.3 * t)[:, None] * turn
    return states


def test_truth_between_its_stamps_is_exact_for_cubics_and_even_turns() -> None:
    stamps = np.arange(0, 2_000_000_001, 10_000_000)
    between = np.arange(0, 2_000_000_001, 1_300_000)
    found = errors(Truth(stamps, moving(stamps)), between, moving(between))
    assert len(found.stamps_ns) == len(between)
    assert found.position.max() < 1e-13
    assert found.attitude.max() < 1e-12
    jerk = 6.0 * np.linalg.norm((0.1, -0.4, 0.3))
    assert found.velocity.max() == pytest.approx(jerk * 0.01**2 / 8.0)  # a line for a parabola


def test_nothing_is_compared_across_a_gap_or_outside_the_truth() -> None:
    stamps = np.array([0, 10, 20, 400, 410]) * 1_000_000
    truth = Truth(stamps, moving(stamps))
    asked = np.array([-1, 0, 15, 20, 21, 399, 400, 405, 410, 411]) * 1_000_000
    expected = [False, True, True, False, False, False, True, True, True, False]
    assert truth.covers(asked).tolist() == expected


def test_angles_are_exact_near_zero_and_blind_to_the_sign() -> None:
    for angle in (0.0, 1e-9, 1e-4, 1.0, 3.0):
        one = np.array([[1.0, 0.0, 0.0, 0.0]])
        other = np.array([[np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0]])
        assert angles(one, other)[0] == pytest.approx(angle, rel=1e-6, abs=1e-15)
        assert angles(one, -other)[0] == pytest.approx(angle, rel=1e-6, abs=1e-15)


def test_body_axes_turn_into_the_world_as_their_quaternion_says() -> None:
    quarter = np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])  # 90 deg about z
    assert np.ravel(rotate(quarter.T, (1.0, 0.0, 0.0))) == pytest.approx([0.0, 1.0, 0.0])


# ---------------------------------------------------------------------- which measurements
@pytest.mark.parametrize(
    ("words", "on"),
    [
        ([], "recorded poses"),
        (["--set", "estimation.position_bandwidth=5"], "recorded poses"),
        (["--set", "bearings.rate=60"], "emulated bearings"),
        (["--set", "tracker.rate=60"], "emulated poses"),
        (["--estimator", "complementary"], "recorded bearings"),
        (["--estimator", "complementary", "--on", "bearings"], "emulated bearings"),
        (["--estimator", "complementary", "--on", "poses"], "recorded poses"),
        (["--estimator", "complementary", "--on", "both"], "recorded poses + recorded bearings"),
        (["--run", "complementary estimation.source=poses", "--on", "bearings"], "recorded poses"),
        (["--run", "complementary tracker.delay=0.02"], "emulated poses"),
    ],
)
def test_the_words_say_what_is_measured(
    capsys: pytest.CaptureFixture[str], log: Path, words: list[str], on: str
) -> None:
    _, report = table(capsys, log, *words)
    assert report["runs"][1]["on"] == on


# ---------------------------------------------------------------------- bad words and bad logs
def complaint(capsys: pytest.CaptureFixture[str], words: list[str], status: int) -> str:
    assert main(words) == status
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, f"not one line: {captured.err}"
    assert lines[0].startswith("quadlab: ")
    assert not captured.out
    return lines[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--estimator", "kalman"], "there are complementary, error_state"),
        (["--run", ""], "write the estimator first"),
        (["--run", "estimation.preset=paper"], "write the estimator first"),
        (["--run", "error_state 'x"], "close the quotes"),
        (["--run", "error_state bearings.sigma"], "name=value"),
        (["--run", "error_state bearings.sigma=0"], "allowed 0.05 to 20 °"),
        (["--run", "error_state bearings.sgma=1"], "bearings.sigma"),
        (["--run", "complementary estimation.preset=sporty"], "there are paper"),
        (["--set", "model.mass=1"], "a replay changes estimation.*"),
        (["--set", "estimation.shadow=error_state"], "its own --run"),
        (
            ["--estimator", "complementary", "--set", "estimation.estimator=error_state"],
            "each its own run",
        ),
        (
            ["--estimator", "error_state", "--on", "poses", "--set", "bearings.sigma=2"],
            "only poses are used",
        ),
        (
            ["--run", "error_state tracker.delay=0.1 estimation.source=bearings"],
            "only bearings are used",
        ),
        (["--on", "recorded-bearings", "--set", "bearings.sigma=2"], "use --on bearings"),
        (["--on", "radar"], "recorded-bearings"),
        (["--from", "5", "--to", "4"], "the first must be earlier"),
        (["--from", "nan"], "finite"),
        (["--from", "1000"], "airborne from"),
        (["--plot", "errors.txt"], "try .png"),
    ],
)
def test_wrong_words_are_answered_in_one_line(
    capsys: pytest.CaptureFixture[str], log: Path, words: list[str], said: str
) -> None:
    assert said in complaint(capsys, ["replay", str(log), *words], 2)


@pytest.mark.parametrize(
    ("left_out", "words", "said"),
    [
        ({"truth"}, [], "--truth tracker"),
        ({"truth", "tracker_pose"}, [], "no tracker poses either"),
        ({"tracker_pose"}, ["--truth", "tracker"], "no tracker poses"),
        ({"tracker_pose"}, ["--on", "poses"], "holds no poses"),
        ({"bearings"}, ["--on", "recorded-bearings"], "holds no bearings"),
        ({"imu"}, [], "no IMU samples"),
    ],
)
def test_a_log_that_lacks_something_is_told_what(
    capsys: pytest.CaptureFixture[str],
    log: Path,
    tmp_path: Path,
    left_out: set[str],
    words: list[str],
    said: str,
) -> None:
    poorer = without(log, tmp_path / "poorer.mcap", left_out)
    assert said in complaint(capsys, ["replay", str(poorer), *words], 1)


def test_what_is_no_log_or_a_torn_one_is_refused(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    assert "is not a file" in complaint(capsys, ["replay", str(tmp_path / "no.mcap")], 1)
    assert "a folder" in complaint(capsys, ["replay", str(tmp_path)], 1)
    text = tmp_path / "text.mcap"
    text.write_text("t,x,y\n")
    assert "not an MCAP log" in complaint(capsys, ["replay", str(text)], 1)
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(log.read_bytes()[:-300_000])
    assert f"`quadlab log recover {torn}`" in complaint(capsys, ["replay", str(torn)], 1)
    assert main(["log", "recover", str(torn)]) == 0
    assert main(["replay", str(torn)]) == 0


def test_without_matplotlib_it_is_said_how_to_get_it(
    capsys: pytest.CaptureFixture[str], log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "pip install matplotlib" in complaint(
        capsys, ["replay", str(log), "--plot", "errors.png"], 2
    )


def test_files_that_cannot_be_written_are_refused_before_anything_runs(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path
) -> None:
    nowhere = tmp_path / "nowhere" / "table.csv"
    assert "no folder" in complaint(capsys, ["replay", str(log), "--csv", str(nowhere)], 1)
    before = log.read_bytes()
    assert "the log itself" in complaint(capsys, ["replay", str(log), "--csv", str(log)], 2)
    assert log.read_bytes() == before
