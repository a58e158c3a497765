"""Estimators of one's own: one that flies, ones that do harm, and changes between estimators."""

from __future__ import annotations

import math
import re
import socket
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimation import names, registry
from estimation.parameters import EstimationParameters
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.records import ESTIMATE, IMU_SAMPLE, new_state, pose_sample
from tests.support.lab import Lab, flight_parameters, refusal
from vehicle.estimators.contract import ESTIMATOR, INPUT, OUTPUT, Answer, Input, load
from vehicle.estimators.estimators import Estimators
from vehicle.estimators.external import ExternalEstimator
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.offer import offer_estimators
from vehicle.estimators.rescue import Rescue
from vehicle.plugins.contract import as_attributes
from vehicle.plugins.external import CONSECUTIVE
from vehicle.plugins.plugins import Plugins

DOCUMENT = Path(__file__).parents[3] / "docs" / "extending" / "plugins.md"
SECTION = (
    DOCUMENT.read_text()
    .partition("# An estimator of your own")[2]
    .partition("# A behavior of your own")[0]
)
SIMPLE = """
import numpy as np

class estimator:
    def reset(self, x):
        self.p, self.v, self.q = x.start_position_w, x.start_velocity_w, x.start_quaternion_wb
        self.early = (x.time, self.p)

    def step(self, x):
        w, v = self.q[0], self.q[1:]
        turn = 0.5 * x.dt * x.angular_velocity_b
        self.q = self.q + np.append(-v @ turn, w * turn + np.cross(v, turn))
        f = x.specific_force_b
        a = f + 2.0 * np.cross(v, np.cross(v, f) + w * f) - [0.0, 0.0, 9.81]
        self.p, self.v = self.p + self.v * x.dt, self.v + a * x.dt
        if x.pose_count:
            e = x.pose_position_w - self.p
            self.p, self.v = self.p + 0.1 * e, self.v + 0.5 * e
            self.q = self.q + 0.05 * (np.copysign(1.0, self.q @ x.pose_quaternion_wb)
                                      * x.pose_quaternion_wb - self.q)
        self.q = self.q / np.sqrt(self.q @ self.q)
        p, v, q = self.p, self.v, self.q
        HARM
        return p, v, q
"""
"""A filter with fixed gains; harm begins at the time that it names."""
SPOILT: dict[str, tuple[dict[str, tuple[float, ...]], str]] = {
    "nan": ({"position_w": (0.0, math.nan, 1.0)}, r"position_w \[0.0, nan, 1.0\].*not finite"),
    "inf": ({"velocity_w": (0.0, 0.0, math.inf)}, "velocity_w .*not finite"),
    "no rotation": ({"quaternion_wb": (0.0, 0.0, 0.0, 0.0)}, "not of unit length"),
    "bias": ({"gyroscope_bias_b": (math.nan, 0.0, 0.0)}, "gyroscope_bias_b .*not finite"),
    "variance": ({"position_variance_w": (-1.0, 0.0, 0.0)}, "no variance"),
    "away": ({"position_w": (0.0, 0.0, 1.3)}, r"0\.3\d\d m.* from complementary; allowed 0.250 m"),
    "fast": ({"velocity_w": (0.6, 0.0, 0.0)}, r"0\.6\d\d m/s"),
    "turned": ({"quaternion_wb": (math.cos(0.1), math.sin(0.1), 0.0, 0.0)}, "11.46°"),
}
"""Wrong values in an answer for a vehicle at rest 1 m above the origin."""
HARM = {
    "raises": ("if x.time > 0.101: 1 / 0", "own.py line 23: ZeroDivisionError: division by zero"),
    "shape": ("if x.time > 0.101: p = np.zeros(7)", "ValueError"),
    "sleeps": ("if x.time > 0.101: import time; time.sleep(10)", "no answer in time to 1 inputs"),
    "crashes": (
        "if x.time > 0.101: import os, signal; os.kill(os.getpid(), signal.SIGKILL)",
        "killed by SIGKILL",
    ),
    "memory": ("if x.time > 0.101: self.hoard = bytearray(3 << 29)", "MemoryError"),
    "ends": ("if x.time > 0.101: raise SystemExit", "SystemExit"),
}
"""Harm that can only be done in a process of its own."""


@dataclass
class Here:
    """A link to a plugin that is called in this process: its answer comes with the next tick."""

    plugin: Any
    spoil: dict[str, tuple[float, ...]] = field(default_factory=dict)
    silent: bool = False
    inputs: list[Input] = field(default_factory=list)
    answers: list[bytes] = field(default_factory=list)
    closed: bool = False

    def ready(self) -> bool:
        return True

    def send(self, data: bytes) -> None:
        x, out = (
            as_attributes(np.frombuffer(data, ESTIMATOR.inputs)),
            np.zeros(1, ESTIMATOR.outputs),
        )
        self.inputs.append(x)
        ESTIMATOR.step(self.plugin, x, out)
        for name, value in self.spoil.items():
            out[name] = value
        self.answers += [] if self.silent else [out.tobytes()]

    def receive(self) -> bytes | None:
        return self.answers.pop(0) if self.answers else None

    def close(self) -> None:
        self.closed = True


class Only(Plugins):
    """The plugin `own` at the end of a link."""

    def __init__(self, link: Here) -> None:
        super().__init__(ESTIMATOR, None, True, ())
        self._only = link

    def names(self) -> tuple[str, ...]:
        return ("own",)

    def start(self, name: str) -> Here:
        return self._only


class Bench:
    """The navigation of a vehicle at rest 1 m above the origin, with rescues, at 500 Hz.

    Args:
        link: of every estimator called own; those of `folder` where there is none.
    """

    def __init__(
        self,
        values: Mapping[str, ParameterValue],
        link: Here | None = None,
        folder: Path | None = None,
    ) -> None:
        self.said: list[str] = []
        self.parameters = EstimationParameters().model_copy(deep=True)
        self.estimators = Estimators(folder)
        if link is not None:
            self.estimators._plugins = Only(link)
        names.offer((names.UDP, *self.estimators._plugins.names()))
        self.set(values)
        self.state, self.estimate = new_state(), np.zeros(1, ESTIMATE)
        self.navigation = Navigation(
            self.parameters, lambda line, level: self.said.append(line), estimators=self.estimators
        )
        self.rescue = Rescue(self.parameters, self.navigation, self.state)
        self.ticks, self.imu = 0, np.zeros(1, IMU_SAMPLE)
        self.imu["specific_force_b"] = (0.0, 0.0, 9.81)

    def set(self, values: Mapping[str, ParameterValue]) -> None:
        store = ParameterStore(self.parameters)
        store.preset({name.removeprefix("estimation."): value for name, value in values.items()})

    def change(self, values: Mapping[str, ParameterValue], armed: bool = True) -> None:
        extra = self.navigation.check(values, self.state, armed)
        self.set({**values, **extra})
        self.navigation.configure(self.parameters)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.002)):
            self.ticks += 1
            now_ns = 2_000_000 * self.ticks
            if self.ticks % 5 == 0:
                pose = pose_sample(now_ns - 1_000_000, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
                self.navigation.measure(pose)
            self.imu["stamp_ns"] = now_ns
            self.navigation.step(self.imu, 0.002, self.state, self.estimate)
            for external in self.navigation.externals:
                self.said += external.news(False)
            change = self.rescue.check(now_ns)
            if change is not None:
                self.said.append(f"tick {self.ticks}: {change.why}")
                self.set(change.values)
                self.navigation.configure(self.parameters)
                self.navigation.take_over(self.state)

    @property
    def own(self) -> ExternalEstimator:
        return self.navigation.externals[0]


@pytest.fixture(autouse=True)
def no_names_left() -> Iterator[None]:
    yield
    names.offer(())


@pytest.fixture
def plugin(tmp_path: Path) -> Callable[[str], Path]:
    """Write plugins/own.py with some harm; return the folder."""

    def written(harm: str = "pass") -> Path:
        (tmp_path / "own.py").write_text(SIMPLE.replace("HARM", harm))
        return tmp_path

    return written


@pytest.fixture
def link(tmp_path: Path) -> Here:
    """Return the link to the example of the document."""
    example = SECTION.partition("```python\n")[2].partition("```")[0]
    (tmp_path / "own.py").write_text(example)
    return Here(load(tmp_path / "own.py"))


FLOWN: dict[str, ParameterValue] = {"estimation.estimator": "own"}
BESIDE: dict[str, ParameterValue] = {"estimation.shadow": "own"}


def test_what_it_answers_is_the_estimate_from_the_sample_after(link: Here) -> None:
    bench = Bench(FLOWN, link)
    bench.run(0.1)
    link.spoil = {
        "position_w": (0.01, 0.0, 1.0),
        "velocity_w": (0.1, 0.0, 0.0),
        "gyroscope_bias_b": (0.0, 0.02, 0.0),
        "position_variance_w": (4e-6, 4e-6, 9e-6),
    }
    bench.run(0.004)
    assert bench.state["position_w"][0] == pytest.approx([0.01 + 0.002 * 0.1, 0.0, 1.0], abs=1e-6)
    assert bench.state["velocity_w"][0] == pytest.approx([0.1, 0.0, 0.0], abs=1e-3)
    assert bench.state["angular_velocity_b"][0] == pytest.approx([0.0, -0.02, 0.0], abs=1e-3)
    assert bench.estimate["gyroscope_bias_b"][0].tolist() == [0.0, 0.02, 0.0]
    assert bench.estimate["position_variance_w"][0].tolist() == [4e-6, 4e-6, 9e-6]


def test_it_begins_at_the_built_in_state_and_gets_each_measurement_with_its_time(
    link: Here,
) -> None:
    bench = Bench(FLOWN, link)
    bench.run(0.1)
    first, *others = link.inputs
    assert (first.reset, sum(x.reset for x in others)) == (1.0, 0.0)
    assert first.start_position_w == pytest.approx([0.0, 0.0, 1.0])
    posed = [x for x in link.inputs if x.pose_count]
    assert len(posed) == pytest.approx(0.1 / 0.01, abs=2)
    assert posed[1].time - posed[1].pose_time == pytest.approx(0.003)
    bench.navigation.reset()  # the gyroscope was calibrated again
    bench.run(0.02)
    assert [x.reset for x in link.inputs].count(1.0) == 2


@pytest.mark.parametrize("kind", SPOILT)
def test_a_bad_answer_is_never_flown_and_the_built_in_one_takes_over_in_that_tick(
    link: Here, kind: str
) -> None:
    spoil, why = SPOILT[kind]
    bench = Bench(FLOWN, link)
    bench.run(0.1)
    link.spoil = dict(spoil)
    bench.run(0.004)  # asked in the first tick, read in the second
    assert bench.parameters.estimator == "complementary"
    line = next(one for one in bench.said if "disengaged" in one)
    assert line.startswith("tick 52: estimator own disengaged, complementary took over: ")
    assert re.search(why, line), line
    assert bench.state["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)
    assert link.closed
    assert bench.navigation.externals == ()


def test_in_real_time_missing_answers_are_bridged_by_the_imu_until_there_are_25(link: Here) -> None:
    bench = Bench(FLOWN, link)
    bench.own._waits = False
    bench.run(0.1)
    link.silent = True
    bench.run(0.002 * CONSECUTIVE)
    assert bench.parameters.estimator == "own"
    assert bench.state["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)
    bench.run(0.002)
    assert bench.parameters.estimator == "complementary"
    assert f"no answer in time to {CONSECUTIVE} inputs in a row" in bench.said[-2]


@pytest.mark.parametrize("kind", HARM)
def test_a_process_that_does_harm_is_replaced_in_that_tick(
    plugin: Callable[[str], Path], kind: str
) -> None:
    harm, why = HARM[kind]
    bench = Bench(FLOWN, folder=plugin(harm))
    bench.run(0.2)
    assert bench.parameters.estimator == "complementary"
    line = next(one for one in bench.said if "disengaged" in one)
    assert why in line
    assert line.startswith("tick 52: ")
    assert bench.state["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)


def test_as_a_shadow_it_may_be_far_off_and_is_handed_over_to_only_when_near(link: Here) -> None:
    bench = Bench(BESIDE, link)
    link.spoil = {"position_w": (0.4, 0.0, 1.0)}
    bench.run(1.5)
    assert str(bench.navigation.running.shadow) == "own on poses"
    assert "0.400 m" in refusal(lambda: bench.change(FLOWN))
    link.spoil = {}
    bench.run(0.01)
    bench.change(FLOWN)
    bench.run(0.1)
    assert str(bench.navigation.running.active) == "own on poses"
    assert bench.parameters.shadow == "complementary"
    bench.change({"estimation.estimator": "complementary"})
    bench.run(0.1)
    assert str(bench.navigation.running.active) == "complementary on poses"
    assert not [line for line in bench.said if "disengaged" in line or "stopped" in line]


def test_a_shadow_that_fails_is_dropped_and_nothing_else_changes(link: Here) -> None:
    bench = Bench(BESIDE, link)
    bench.run(0.1)
    link.spoil = {"position_w": (math.nan, 0.0, 1.0)}
    bench.run(0.004)
    assert bench.navigation.running.shadow is None
    assert "shadow own stopped: it answered position_w [nan" in bench.said[-1]
    assert link.closed
    assert bench.parameters.estimator == "complementary"


def test_the_built_in_one_beneath_may_be_chosen_in_flight_at_any_time(link: Here) -> None:
    bench = Bench(FLOWN, link)
    bench.run(1.5)
    assert "stays complementary while own runs" in refusal(
        lambda: bench.change({"estimation.plugin.built_in": "error_state"})
    )
    bench.change({"estimation.estimator": "complementary"})
    assert str(bench.navigation.running.active) == "complementary on poses"
    assert link.closed
    assert "is started on the ground" in refusal(lambda: bench.change(BESIDE))


def test_on_bearings_the_reserve_is_the_built_in_one(link: Here) -> None:
    bench = Bench({**FLOWN, "estimation.source": "bearings"}, link)
    assert str(bench.navigation.running.active) == "own on bearings"
    assert str(bench.navigation.running.reserve) == "complementary on poses"


def test_a_program_answers_over_udp_as_the_estimator_and_its_wrong_packet_ends_it() -> None:
    """An estimator that gets IMU and poses, and answers one tick later."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free,
    ):
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(5.0)
        free.bind(("", 0))
        port = free.getsockname()[1]
        free.close()
        bench = Bench(
            {
                "estimation.estimator": "udp",
                "estimation.plugin.udp_peer": f"127.0.0.1:{peer.getsockname()[1]}",
                "estimation.plugin.udp_port": port,
            }
        )
        bench.run(0.01)  # up to the first pose, with which it begins
        poses = 0
        for _ in range(50):
            bench.run(0.002)
            data, sender = peer.recvfrom(4096)
            numbers = struct.unpack("<225d", data)
            poses += int(numbers[19])
            answer = (numbers[0], 0.01, 0.0, 1.0, *[0.0] * 3, 1.0, *[0.0] * 9, *[math.nan] * 9)
            peer.sendto(struct.pack("<26d", *answer), sender)
        assert (bench.own.missed, bench.own.failure, poses) == (0, "", 10)
        assert bench.state["position_w"][0] == pytest.approx([0.01, 0.0, 1.0], abs=1e-6)
        peer.sendto(b"short", ("127.0.0.1", port))
        bench.run(0.004)
        why = "a packet of 5 bytes came, expected 208: 26 doubles, time, position_w"
        assert why in "".join(bench.said)
        assert bench.parameters.estimator == "complementary"


def test_a_law_is_no_estimator_and_a_name_that_is_not_there_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(SIMPLE)
    (tmp_path / "mine.py").write_text("class law: ...\n")
    found = Estimators(tmp_path)
    offer_estimators(tmp_path)
    choices = ParameterStore(EstimationParameters()).description("shadow").choices
    assert choices == ("none", "complementary", "error_state", "udp", "own")
    with pytest.raises(RefusedError, match=r"'mine' is not an estimator; there are .*, own; put"):
        found.check("estimation.estimator", "mine")


def test_the_vehicle_tells_why_it_goes_on_with_the_built_in_one(
    plugin: Callable[[str], Path],
) -> None:
    folder = plugin("if x.time > 0.4: 1 / 0")
    offer_estimators(folder)
    parameters = flight_parameters()
    parameters.estimation.estimator = "own"
    lab = Lab(parameters, plugins=folder)
    lab.wait(0.3)
    assert lab.parameter("estimation.estimator") == "own"
    assert "estimator own is ready" in lab.said
    lab.wait(0.2)
    assert lab.parameter("estimation.estimator") == "complementary"
    assert "estimator own disengaged, complementary took over: own.py line 23" in lab.said
    assert lab.error() < 0.02
    lab.stack.close()


def test_a_program_runs_it_by_name_and_is_told_why_it_fails(
    plugin: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(names, "registered", {})
    Estimators(plugin("if x.time > 0.05: 1 / 0")).register()
    own, state, imu = (
        registry.create("own", EstimationParameters()),
        new_state(),
        np.zeros(1, IMU_SAMPLE),
    )
    imu["specific_force_b"] = (0.0, 0.0, 9.81)

    def run(ticks: range) -> None:
        for k in ticks:
            imu["stamp_ns"] = 2_000_000 * k
            own.predict(imu, 0.002, state)
            if k % 5 == 0:
                pose = pose_sample(2_000_000 * k, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
                own.correct(pose, np.zeros(1, ESTIMATE))

    run(range(1, 20))
    assert state["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)
    with pytest.raises(RefusedError, match="ZeroDivisionError"):
        run(range(20, 60))


def test_the_document_lists_every_field_of_the_contract_in_order() -> None:
    cells = [line.split("|") for line in SECTION.splitlines()]
    rows = [row[1:4] for row in cells if len(row) == 6 and "`" in row[1]]
    listed = [(name.strip(" `"), int(size), unit.strip()) for name, size, unit in rows]
    assert listed == [(f.name, f.size, f.unit) for f in (*INPUT, *OUTPUT)]
    assert Answer._fields == tuple(f.name for f in OUTPUT[1:])
