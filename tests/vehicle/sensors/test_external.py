"""Sensors of one's own: they correct the filter, and one that fails is out in that tick."""

from __future__ import annotations

import re
import socket
from pathlib import Path

import numpy as np
import pytest

from estimation.error_state.estimator import ErrorStateEstimator
from estimation.estimator import Estimator
from estimation.outcome import JudgedReading
from estimation.parameters import EstimationParameters
from quadrotor.checkout import ROOT
from quadrotor.errors import RefusedError
from quadrotor.records import ESTIMATE, IMU_SAMPLE, Record, new_state, pose_sample
from quadrotor.rotations import quaternion_exp, quaternion_multiply, rotate
from tests.support.here_link import HereLink
from vehicle.estimators.estimator_runner import Runner
from vehicle.estimators.external import ExternalEstimator
from vehicle.estimators.navigation import Navigation
from vehicle.sensors.contract import (
    INPUT,
    INPUT_TYPE,
    OUTPUT_TYPE,
    SENSOR,
    Reading,
    at_rest,
    load,
    step,
)
from vehicle.sensors.external import ExternalSensor
from vehicle.sensors.sensors import OwnSensors

DOCUMENT = (ROOT / "docs" / "extending" / "plugins.md").read_text()
SECTION = DOCUMENT.partition("# A sensor of your own")[2]
HEIGHT = """
from vehicle.sensors.contract import Reading

def expected(p, q):
    return p[2]

class sensor:
    def reset(self, x):
        self.z = 1.0
    def step(self, x):
        self.z, deviation, time = 1.0, 0.02, None
        if x.time > 0.2:
            HARM
        return Reading(self.z, expected, deviation, time)
"""
HARM = {
    "raises": ("1 / 0", "line 13: ZeroDivisionError: division by zero"),
    "ends": ("raise SystemExit", "SystemExit"),
    "nan": ("self.z = float('nan')", "reading nan from what is expected"),
    "inf": ("self.z = float('inf')", "reading inf from what is expected"),
    "no deviation": ("deviation = 0.0", "deviation 0.0, cannot be used"),
    "future": ("time = x.time + 1.0", "a reading is -1.000 s old"),
    "too late": ("time = x.time - 1.0", "a reading is 1.000 s old"),
    "too many": ("return [(1.0, expected, 0.1)] * 9", "9 readings in one step; 8 are taken"),
    "stalls": ("self.stalls = True", "no answer in time to 1 inputs in a row"),
}
LATE_HARM = {
    "off": ("self.z = 3.0", "the gate refused 51% of its last readings, allowed 50%"),
    "drifts": (
        "self.z, deviation = 1.0 + 0.2 * (x.time - 0.2), 1e-3",
        "the filter that it corrects is contradicted: the last 8 measurements",
    ),
}


class Bench:
    """A vehicle at rest 1 m above the origin, on poses, with a sensor."""

    def __init__(self, path: Path, estimator: str = "error_state") -> None:
        parameters = EstimationParameters().model_copy(deep=True)
        parameters.estimator = estimator
        self.navigation = Navigation(parameters, lambda line, level: None)
        self.link = HereLink(SENSOR, path)
        self.sensor = ExternalSensor("mine", self.link, waits=True)
        self.sensor.news(False)
        self.state, self.estimate = new_state(), np.zeros(1, ESTIMATE)
        self.ticks, self.imu, self.judged = 0, np.zeros(1, IMU_SAMPLE), list[Record]()
        self.imu["specific_force_b"] = (0.0, 0.0, 9.81)

    @property
    def filter(self) -> Estimator:
        return self.navigation.active

    def run(self, seconds: float, poses: bool = True, flying: bool = True) -> None:
        for _ in range(round(seconds / 0.002)):
            self.ticks += 1
            now_ns = self.imu["stamp_ns"] = 2_000_000 * self.ticks
            if poses and self.ticks % 5 == 0:
                there = pose_sample(now_ns - 1_000_000, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
                self.navigation.measure(there)
            self.navigation.step(self.imu, 0.002, self.state, self.estimate)
            everything = self.navigation.running.everything()
            self.sensor.step(now_ns, 0.002, self.imu, self.state, 1e5, flying, everything)
            self.judged += self.sensor.judged


def written(folder: Path, harm: str = "pass", source: str = HEIGHT) -> Path:
    path = folder / "mine.py"
    path.write_text(source.replace("HARM", harm))
    return path


def test_a_sensor_holds_what_it_measures_when_no_pose_comes(tmp_path: Path) -> None:
    """The accelerometer is 0.2 m/s² off, which is 0.1 m in 1 s."""
    bench = Bench(written(tmp_path))
    bench.run(0.3)
    bench.imu["specific_force_b"] = (0.0, 0.0, 10.01)
    bench.run(1.0, poses=False)
    assert bench.state["position_w"][0, 2] == pytest.approx(1.0, abs=0.02)
    assert bench.filter.stale  # the vehicle will not fly on it
    assert (bench.sensor.used > 600, bench.sensor.refused) == (True, 0)


@pytest.mark.parametrize("kind", HARM)
def test_a_harmful_sensor_is_out_in_that_tick_and_the_filter_goes_on(
    tmp_path: Path, kind: str
) -> None:
    harm, why = HARM[kind]
    bench = Bench(written(tmp_path, harm))
    bench.run(0.2)
    assert bench.sensor.failure == ""
    bench.run(0.006)  # 101 ticks of its own, and the one in which the answer is read
    assert why in bench.sensor.failure
    bench.run(0.2)
    assert bench.state["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)


@pytest.mark.parametrize("kind", LATE_HARM)
def test_a_sensor_that_contradicts_the_poses_is_out_before_it_does_harm(
    tmp_path: Path, kind: str
) -> None:
    harm, why = LATE_HARM[kind]
    bench = Bench(written(tmp_path, harm))
    farthest = 0.0
    for _ in range(20):
        bench.run(0.1)
        farthest = max(farthest, abs(bench.state["position_w"].item(2) - 1.0))
    assert why in bench.sensor.failure
    assert farthest < 0.25
    assert bench.state["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.01)


def test_what_is_expected_is_differentiated_about_the_axes_of_the_world() -> None:
    """A corner of the body at l: its height grows with the turn phi as (phi x R l)_z."""
    lever_b, out = np.array([0.3, -0.2, 0.1]), np.zeros(1, OUTPUT_TYPE)
    turned = quaternion_exp(np.array([0.3, -0.5, 1.1]))

    class Corner:
        def reset(self, x: object) -> None: ...

        def step(self, x: object) -> Reading:
            return Reading(2.0, lambda p, q: float(p[2] + rotate(q, lever_b)[2]), 0.1)

    x = np.zeros(1, INPUT_TYPE)
    x["position_w"], x["quaternion_wb"] = (1.0, 2.0, 1.5), turned
    step(Corner(), x.view(np.recarray)[0], out)
    lever_w = rotate(turned, lever_b)
    assert out["rest"][0, 0] == pytest.approx(2.0 - 1.5 - lever_w[2])
    expected = [0.0, 0.0, 1.0, lever_w[1], -lever_w[0], 0.0]
    assert out["row"][0, 0] == pytest.approx(expected, abs=1e-9)


def test_a_reading_of_a_while_ago_is_linearised_where_the_vehicle_was() -> None:
    x, out = np.zeros(1, INPUT_TYPE), np.zeros(1, OUTPUT_TYPE)
    x["time"], x["velocity_w"], x["angular_velocity_b"] = 3.0, (1.0, 0.0, 0.0), (0.0, 0.0, 2.0)
    x["quaternion_wb"] = (1.0, 0.0, 0.0, 0.0)

    class Late:
        def reset(self, x: object) -> None: ...

        def step(self, x: object) -> list[Reading]:
            return [Reading(0.0, lambda p, q: float(p[0]), 0.1, time=2.9)]

    step(Late(), x.view(np.recarray)[0], out)
    assert out["position_w"][0, 0] == pytest.approx([-0.1, 0.0, 0.0])
    back = quaternion_multiply(out["quaternion_wb"][0, 0], quaternion_exp(np.array([0, 0, 0.2])))
    assert back == pytest.approx([1.0, 0.0, 0.0, 0.0])


def test_a_filter_that_takes_no_readings_is_left_alone_and_they_are_told(tmp_path: Path) -> None:
    bench = Bench(written(tmp_path, "self.z = 3.0"), "complementary")
    bench.run(0.5)
    assert (bench.sensor.failure, bench.sensor.used, bench.sensor.refused) == ("", 0, 0)
    last = bench.judged[-1][0]
    assert (last["reading"], last["judgement"]) == (3.0, 2)
    assert last["residual"] == pytest.approx(2.0, abs=1e-3)
    assert np.isnan(last["gate"])


def test_each_reading_is_told_once_with_what_the_filter_made_of_it(tmp_path: Path) -> None:
    bench = Bench(written(tmp_path, "self.z = 1.0 if int(1000 * x.time) % 100 else 3.0"))
    bench.run(0.3)
    judged = np.concatenate(bench.judged)
    assert len(judged) == bench.ticks - 1
    assert (judged["judgement"] == 2).tolist() == [True] * 4 + [False] * 145  # before a pose came
    refused = judged["judgement"] == 1
    assert refused.sum() == bench.sensor.refused > 0
    assert (judged["reading"][refused] == 3.0).all()
    assert (abs(judged["residual"])[refused] >= judged["gate"][refused]).all()
    used = judged[judged["judgement"] == 0]
    assert (abs(used["residual"]) < used["gate"]).all()
    assert set(judged["sensor"].tolist()) == {b"mine"}
    assert (np.diff(judged["stamp_ns"]) == 2_000_000).all()


def test_a_reading_reaches_the_filter_beneath_a_plugin_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plugin itself offers all methods of the filter beneath it."""
    bench = Bench(written(tmp_path))
    bench.run(0.1)
    beneath, calls = bench.filter, list[Record]()
    assert isinstance(beneath, ErrorStateEstimator)
    correct = beneath.correct_reading

    def counted(reading: Record) -> JudgedReading:
        calls.append(reading)
        return correct(reading)

    monkeypatch.setattr(beneath, "correct_reading", counted)
    above = ExternalEstimator("own", bench.link, Runner("error_state", "poses", beneath), True)
    bench.sensor.step(0, 0.002, bench.imu, bench.state, 1e5, True, [above, beneath])
    assert len(calls) == 1


def test_a_flight_ends_with_what_was_used_and_refused(tmp_path: Path) -> None:
    bench = Bench(written(tmp_path))
    assert bench.sensor.news(True) == []
    bench.run(0.1)
    (line,) = bench.sensor.news(False)
    told = "sensor mine: 0 of 49 inputs without an answer in time; {} readings used, 0 refused"
    assert line.startswith(told.format(bench.ticks - 5)), line


def test_the_documents_receiver_of_ranges_reads_its_socket(tmp_path: Path) -> None:
    code = SECTION.partition("```python\n")[2].partition("```")[0]
    port = re.search(r"9201", code)
    assert port is not None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        free = probe.getsockname()[1]
    sensor, x = load(written(tmp_path, source=code.replace("9201", str(free)))), at_rest()
    sensor.reset(x)
    assert sensor.step(x) is None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.sendto(b"3 4.25\n", ("127.0.0.1", free))
    reading = sensor.step(x)
    assert isinstance(reading, Reading)
    assert reading.value == 4.25
    assert reading.expected(x.position_w, x.quaternion_wb) == pytest.approx(np.sqrt(19.0))


def test_the_document_lists_what_a_sensor_receives() -> None:
    cells = [line.split("|") for line in SECTION.splitlines()]
    rows = [row[1:5] for row in cells if len(row) == 6 and "`" in row[1]]
    listed = [
        (name.strip(" `"), int(n), unit.strip(), text.strip()) for name, n, unit, text in rows
    ]
    assert listed == [(f.name, f.size, f.unit, f.meaning) for f in INPUT]
    assert SENSOR.group in SECTION


def test_sensors_are_added_on_the_ground_and_left_out_at_any_time(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.py").write_text(HEIGHT)
    own = OwnSensors(tmp_path, waits=True)
    own.check({"estimation.sensors": "one, two"}, armed=False)
    with pytest.raises(RefusedError, match="one is added on the ground: disarm first"):
        own.check({"estimation.sensors": "one"}, armed=True)
    with pytest.raises(
        RefusedError, match=r"'other' is not a sensor; there are none, one, two; put"
    ):
        OwnSensors(tmp_path, True, "other")
    own.configure("one two")
    assert [one.name for one in own.externals] == ["one", "two"]
    own.check({"estimation.sensors": "two"}, armed=True)
    first, second = own.externals
    assert own.without(first) == "two"
    own.configure("two")
    own.configure("two one")  # each keeps its topic while it runs
    assert [(one.name, one.place) for one in own.externals] == [("two", 2), ("one", 1)]
    assert own.externals[0] is second
    own.close()
