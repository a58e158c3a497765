"""Step tests flown in simulated time, judged from the onboard log."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.tuning.collection import Gap, Samples
from extensions.tuning.evaluation import COLUMNS, Plan, drawn, evaluate
from extensions.tuning.step_test_store import StepTest, StepTestStore
from flight_log.tick_columns import layouts_of, parse_column
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import RefusedError, StorageError
from quadrotor.records import TICK, Record
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.topics.ticks import actuator_messages, reference_messages, state_messages

KP = "control.position.kp_xy"


def known(figures: Mapping[str, float | None]) -> dict[str, float]:
    """Return the figures that were reached."""
    return {name: value for name, value in figures.items() if value is not None}


class Ticks:
    """Log that stores ticks and events."""

    def __init__(self) -> None:
        self.kept: list[bytes] = []
        self.events: list[str] = []

    def tick(self, record: Record) -> None:
        self.kept.append(record.tobytes())

    def event(self, event: Any) -> None:
        self.events.append(event.text)

    def __getattr__(self, _: str) -> Any:
        return lambda *_: None


class Lab:
    """Vehicle in hover."""

    def __init__(self, **values: Any) -> None:
        parameters = FlightParameters().model_copy(deep=True)
        parameters.seed(5)
        self.log = Ticks()
        robot = SimulatedVehicle(parameters.simulator)
        self.flight = SimulatedFlight(parameters, robot, self.log)  # type: ignore[arg-type]
        self.flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=5)
        self.flight.wait(0.3)
        if values:
            self.flight.change(values)
        self.flight.arm()
        self.flight.start("take_off", height=1.0)
        self.flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)
        self.flight.wait(2.0)

    def fly(self, plan: Plan) -> Samples:
        self.log.kept.clear()
        self.flight.start(
            "excite",
            axis=plan.axis,
            shape=plan.shape,
            amplitude=plan.amplitude,
            duration=plan.duration,
            repeats=plan.repeats,
        )
        self.flight.wait(0.01)
        self.flight.wait_until(lambda v: v.behavior != "excite", what="the end", timeout=60)
        self.flight.wait(0.4)
        return samples_of(np.frombuffer(b"".join(self.log.kept), TICK))


def samples_of(ticks: Record) -> Samples:
    """Return the samples as the onboard log would: through its messages, as float32."""
    messages = {
        "state": state_messages(ticks),
        "reference": reference_messages(ticks),
        "actuators": actuator_messages(ticks),
    }
    layouts, values = layouts_of("quad1"), {}
    for name in COLUMNS:
        topic, field, item = parse_column(name, layouts)
        column = messages[topic][field]
        values[name] = (column if item is None else column[:, item]).astype(np.float32)
    return Samples(ticks["imu"]["stamp_ns"].copy(), values, (), "", "log.mcap")


@pytest.fixture(scope="module")
def lab() -> Lab:
    return Lab()


@pytest.fixture(scope="module")
def step(lab: Lab) -> tuple[Plan, Samples]:
    plan = Plan("x", "step", 0.3, 2.0, 1)
    return plan, lab.fly(plan)


def test_a_step_on_x_is_flown_and_judged(step: tuple[Plan, Samples]) -> None:
    plan, samples = step
    found = evaluate(samples, plan)
    assert found.problems == []
    assert [edge["swing"] for edge in found.edges] == pytest.approx([0.3, -0.3], abs=1e-6)
    assert [edge["time"] for edge in found.edges] == pytest.approx([0.0, 2.0], abs=0.0041)
    figures = known(found.figures)
    # k_p 4, k_v 3.5, k_i 1: omega 2 rad/s, zeta 0.88, and some overshoot by the integral.
    assert 0.6 < figures["delay"] < 0.95  # (1 + 0.7 zeta) / omega = 0.81 s
    assert 0.5 < figures["rise"] < 1.5
    assert 2.0 < figures["overshoot"] < 25.0
    assert 0.05 < figures["rms_error"] < 0.2
    assert figures["saturated"] == 0.0
    assert 4.0 < figures["peak_tilt"] < 12.0
    assert figures["cross_y"] < 0.03
    assert set(figures) >= {"cross_z", "cross_yaw", "peak_motor", "peak_yaw_torque"}
    assert found.time[0] == pytest.approx(-0.4, abs=0.003)
    assert np.abs(np.diff(found.time) - 0.002).max() < 1e-9


def test_the_aligned_set_point_is_what_was_asked(step: tuple[Plan, Samples]) -> None:
    plan, samples = step
    found = evaluate(samples, plan)
    assert not found.setpoint[found.time < -1e-9].any()
    assert found.setpoint[np.searchsorted(found.time, -1e-9)] == pytest.approx(0.3, abs=1e-6)
    assert np.abs(found.actual[found.time < 0.0]).max() < 0.02


def test_a_stiffer_gain_is_seen_as_a_quicker_rise(lab: Lab, step: tuple[Plan, Samples]) -> None:
    plan, samples = step
    soft = known(evaluate(samples, plan).figures)
    lab.flight.change({KP: 7.0})
    stiff = known(evaluate(lab.fly(plan), plan).figures)
    lab.flight.change({KP: 4.0})
    lab.flight.wait(2.0)
    assert stiff["rise"] < 0.8 * soft["rise"]
    assert stiff["overshoot"] > soft["overshoot"]


@pytest.mark.parametrize(
    "plan", [Plan("z", "doublet", 0.2, 1.5, 1), Plan("yaw", "step", -0.3, 1.5, 2)]
)
def test_other_axes_and_shapes(lab: Lab, plan: Plan) -> None:
    found = evaluate(lab.fly(plan), plan)
    assert found.problems == []
    assert len(found.edges) == plan.edges
    swings = {"doublet": [0.2, -0.4, 0.2], "step": [-0.3, 0.3, -0.3, 0.3]}[plan.shape]
    assert [edge["swing"] for edge in found.edges] == pytest.approx(swings, abs=1e-5)
    for edge in map(known, found.edges):
        assert 0.05 < edge["delay"] < 0.8
        assert abs(edge["steady_error"]) < 0.1 * abs(edge["swing"]) + 0.02
    lab.flight.wait(2.0)


def test_a_gap_is_said_drawn_and_its_edge_not_judged(step: tuple[Plan, Samples]) -> None:
    plan, samples = step
    time = samples.time
    kept = (time < 3.0) | (time > 3.2)
    torn = Samples(
        samples.stamps_ns[kept],
        {k: v[kept] for k, v in samples.values.items()},
        (Gap(3.0, 3.2),),
        "",
        "log.mcap",
    )
    found = evaluate(torn, plan)
    assert "1 gap in the vehicle's log, 200 ms" in found.problems[0]
    assert found.edges[0]["rise"] is not None
    assert found.edges[1]["rise"] is None
    lines = drawn(found)
    hole = lines["actual"].index(None)
    assert lines["setpoint"][hole] is None
    assert lines["time"][hole - 1] < lines["time"][hole] < lines["time"][hole + 1]
    assert lines["time"][hole + 1] - lines["time"][hole - 1] == pytest.approx(0.2, abs=0.005)
    assert len(lines["time"]) == len(found.time) + 1


def test_a_test_that_ends_early_says_so(step: tuple[Plan, Samples]) -> None:
    plan, samples = step
    kept = samples.time < 1.5
    cut = Samples(
        samples.stamps_ns[kept], {k: v[kept] for k, v in samples.values.items()}, (), "", ""
    )
    assert evaluate(cut, plan).problems == ["it ended early: 1 of 2 edges were flown"]
    kept = samples.time < 0.3
    nothing = Samples(
        samples.stamps_ns[kept], {k: v[kept] for k, v in samples.values.items()}, (), "", ""
    )
    with pytest.raises(StorageError, match="does not step"):
        evaluate(nothing, plan)


def test_in_flight_it_is_refused_in_motion_and_ended_by_brake(lab: Lab) -> None:
    lab.flight.start("excite", axis="x", amplitude=0.3, duration=3.0)
    lab.flight.wait(1.0)
    lab.flight.start("brake")
    lab.flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=5)
    with pytest.raises(RefusedError, match="not at rest"):
        lab.flight.start("excite")
    lab.flight.wait(3.0)


def test_gains_that_do_not_hold_the_path_end_the_test_by_braking() -> None:
    lab = Lab()
    lab.flight.change({"behavior.excite_error_max": 0.05, "control.position.kv_xy": 2.0})
    lab.flight.change({KP: 8.0})
    lab.flight.start("excite", axis="y", amplitude=0.3, duration=3.0)
    lab.flight.wait_until(lambda v: v.behavior != "excite", what="the end", timeout=5)
    assert lab.flight.view().behavior == "brake"
    assert any("braking: y = " in text for text in lab.log.events)
    lab.flight.wait(0.5)
    found = evaluate(
        samples_of(np.frombuffer(b"".join(lab.log.kept), TICK)[-2000:]),
        Plan("y", "step", 0.3, 3.0, 1),
    )
    # The reference then jumps to the vehicle: no edge of the test.
    assert found.problems == ["it ended early: 1 of 2 edges were flown"]
    assert found.figures["rise"] is None


def kept(runs: StepTestStore, samples: Samples, **changes: Any) -> StepTest:
    fields = {
        "id": runs.new_id("quad1"),
        "started": "2026-01-01T00:00:00+00:00",
        "vehicle": "quad1",
        "requester": "anna",
        "run_id": "",
        "plan": Plan("x", "step", 0.3, 2.0, 1),
        "gains": {KP: 4.0},
        "changed": [],
        "figures": {"rise": 0.5},
        "edges": [],
        "problems": [],
    }
    run = StepTest(**{**fields, **changes})
    runs.keep(run, samples)
    return run


def test_the_last_ones_are_kept_and_found_again(tmp_path: Any, step: Any) -> None:
    _, samples = step
    runs = StepTestStore(tmp_path, kept=3)
    made = [kept(runs, samples, gains={KP: float(i)}) for i in range(5)]
    again = StepTestStore(tmp_path, kept=3)
    assert again.runs() == made[:1:-1]
    assert len(list((tmp_path / "tuning").glob("*.npz"))) == 3
    read = again.samples(made[-1].id)
    np.testing.assert_array_equal(read.stamps_ns, samples.stamps_ns)
    for name, values in samples.values.items():
        np.testing.assert_array_equal(read.values[name], values)
    with pytest.raises(StorageError, match="there is no step test"):
        again.run(made[0].id)


def test_a_deleted_one_comes_back(tmp_path: Any, step: Any) -> None:
    runs = StepTestStore(tmp_path)
    first, second = (kept(runs, step[1]) for _ in range(2))
    runs.delete(first.id)
    assert runs.runs() == [second]
    with pytest.raises(StorageError):
        runs.samples(first.id)
    runs.restore(first.id)
    assert runs.runs() == [second, first]
    assert len(runs.samples(first.id).stamps_ns) == len(step[1].stamps_ns)


@pytest.mark.parametrize("name", ["../web/door", "x", "", "20260101T000000000Z_../x"])
def test_a_name_from_outside_is_never_a_path(tmp_path: Any, name: str) -> None:
    runs = StepTestStore(tmp_path)
    for act in (runs.run, runs.samples, runs.delete, runs.restore):
        with pytest.raises(StorageError, match="there is no step test"):
            act(name)


def test_an_unreadable_one_is_left_out(tmp_path: Any, step: Any) -> None:
    runs = StepTestStore(tmp_path)
    whole, torn = (kept(runs, step[1]) for _ in range(2))
    (tmp_path / "tuning" / f"{torn.id}.json").write_text("{")
    assert runs.runs() == [whole]
    with pytest.raises(StorageError, match="cannot be read"):
        runs.run(torn.id)


def test_nothing_is_kept_in_a_data_folder_that_is_gone(tmp_path: Path) -> None:
    data = tmp_path / "gone"
    with pytest.raises(StorageError, match=r"cannot be kept: .*No such file"):
        StepTestStore(data).keep(None, None)  # type: ignore[arg-type]  # refused before it looks
    assert not data.exists()
