"""References of another program: flown as they arrive, or refused with the reason."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from control.behaviors.machine import BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from control.trajectories.feasibility import survey
from quadrotor.errors import Refusal, RefusedError
from quadrotor.records import Record, new_reference, new_state

DT = 0.002
WEIGHT = 1.308 * 9.81
RADIUS, OMEGA, HEIGHT = 1.0, 1.2, 1.0
Program = Callable[[float], Record]


def circle(t: float, begin: float = 0.0) -> Record:
    """Return a circle around the origin from (RADIUS, 0), with all derivatives; the yaw follows."""
    out = new_reference()
    angle = OMEGA * (t - begin)
    turned = np.array([math.cos(angle), math.sin(angle), 0.0])
    ahead = np.array([-math.sin(angle), math.cos(angle), 0.0])
    out["position_w"] = RADIUS * turned + (0.0, 0.0, HEIGHT)
    out["velocity_w"], out["acceleration_w"] = RADIUS * OMEGA * ahead, -RADIUS * OMEGA**2 * turned
    out["jerk_w"], out["snap_w"] = -RADIUS * OMEGA**3 * ahead, RADIUS * OMEGA**4 * turned
    out["yaw"], out["yaw_rate"] = angle, OMEGA
    return out


def standing(x: float = 0.0, y: float = 0.0, z: float = HEIGHT, yaw: float = 0.0) -> Record:
    out = new_reference()
    out["position_w"], out["yaw"] = (x, y, z), yaw
    return out


class Bench:
    """Machine that hovers, and a program that sends `rate` references a second."""

    def __init__(self, x: float = 0.0, rate: int = 50, **changes: Any) -> None:
        self.machine = BehaviorMachine(BehaviorParameters(**changes), WEIGHT)
        self.state, self.reference = new_state(), new_reference()
        self.state["position_w"] = (x, 0.0, 0.0)
        self.stamp_ns, self._every = 0, round(1 / (rate * DT))
        self.ticks = 0
        self.machine.request("take_off", {"height": HEIGHT}, self.state, True, True)
        self.run(6.0)
        assert self.machine.name is BehaviorName.HOVER

    @property
    def time(self) -> float:
        return self.stamp_ns * 1e-9

    def send(self, reference: Record, age: float = 0.0) -> None:
        stamp_ns = self.stamp_ns - round(age * 1e9)
        self.machine.outside.store(stamp_ns, reference.view("f8").tolist())

    def flies(self, name: BehaviorName) -> bool:
        return self.machine.name is name

    def start(self) -> None:
        self.machine.request("external", {}, self.state, True, True)

    def run(self, seconds: float, program: Program | None = None) -> Record:
        """Return all references of this time, (N,)."""
        out = []
        for _ in range(round(seconds / DT)):
            self.stamp_ns += round(DT * 1e9)
            self.ticks += 1
            if program is not None and self.ticks % self._every == 0:
                self.send(program(self.time))
            self.machine.step(self.stamp_ns, DT, self.state, None, WEIGHT, self.reference)
            self.state["position_w"] = self.reference["position_w"]
            out.append(self.reference.copy())
        return np.concatenate(out)


def test_a_program_of_fifty_references_a_second_is_flown_tick_by_tick() -> None:
    bench = Bench(RADIUS)
    begin = bench.time
    bench.send(circle(begin, begin))
    bench.start()
    flown = bench.run(8.0, lambda t: circle(t, begin))
    assert bench.machine.name is BehaviorName.EXTERNAL
    times = begin + DT * np.arange(1, len(flown) + 1)
    wanted = np.concatenate([circle(t, begin) for t in times])
    # Until the program's first reference arrives, after some 20 ms, the machine's own is
    # extrapolated.
    for name, most in (("position_w", 1e-6), ("velocity_w", 2e-4), ("acceleration_w", 0.02)):
        assert np.abs(flown[name] - wanted[name]).max() < most, name
    np.testing.assert_allclose(flown["yaw"], wanted["yaw"], atol=1e-9)


def test_a_program_that_falls_silent_leaves_the_vehicle_hovering_where_it_stops() -> None:
    bench = Bench(RADIUS)
    begin = bench.time
    bench.send(circle(begin, begin))
    bench.start()
    bench.run(2.0, lambda t: circle(t, begin))
    flown = bench.run(0.25)
    assert bench.flies(BehaviorName.BRAKE)
    assert bench.machine.aborted == (
        "the newest reference of the topic external_reference is 0.20 s old; allowed 0.2 s "
        "(behavior.external_timeout); send 20 a second or more"
    )
    flown = np.concatenate([flown, bench.run(3.0)])
    assert bench.flies(BehaviorName.HOVER)
    steps = np.linalg.norm(np.diff(flown["position_w"], axis=0), axis=1)
    assert steps.max() < 1.1 * RADIUS * OMEGA * DT
    np.testing.assert_array_equal(flown["velocity_w"][-1], 0.0)


@pytest.mark.parametrize("silent_after", [5.0, *np.arange(1.0, 2.0, 0.25)])
def test_a_wall_is_not_flown_through_whenever_the_program_falls_silent(silent_after: float) -> None:
    wall = 1.0

    def faster(t: float) -> Record:
        out = standing(0.25 * (t - begin) ** 2)
        out["velocity_w"][0, 0], out["acceleration_w"][0, 0] = 0.5 * (t - begin), 0.5
        return out

    bench = Bench(volume_x_max=wall)
    begin = bench.time
    bench.send(standing())
    bench.start()
    bench.run(silent_after, faster)
    bench.run(4.0)
    assert bench.machine.name is BehaviorName.HOVER
    said = (
        r"stop at x = 1\.\d+ m, outside .* -3 to 1 m \(behavior.volume_x_min, behavior.volume_x_max"
    )
    x = bench.reference["position_w"][0, 0]
    if silent_after == 5.0:
        assert re.search(said, bench.machine.aborted)
        assert wall - 0.3 < x <= wall
    else:
        assert 0.1 < x <= wall


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (
            standing(0.3),
            r"the reference is 0.30 m off .*allowed 0.2 m \(behavior.external_step_max",
        ),
        (standing(yaw=-0.6), r"the reference's yaw steps by -0.60 rad; allowed 0.5 rad"),
        (standing(math.nan), r"the reference is nan m off"),
        (standing(yaw=math.nan), r"the reference's yaw steps by nan"),
    ],
)
def test_a_reference_that_steps_is_not_flown(reference: Record, said: str) -> None:
    bench = Bench()
    bench.send(reference)
    with pytest.raises(RefusedError, match=f"external refused: {said}"):
        bench.start()
    assert bench.machine.name is BehaviorName.HOVER
    bench.send(standing())
    bench.start()
    bench.send(reference)
    bench.run(0.1)
    assert bench.machine.name is BehaviorName.HOVER, "braked, and stood at once"
    assert bench.machine.aborted
    assert np.abs(bench.reference["position_w"][0] - (0.0, 0.0, HEIGHT)).max() < 1e-6


def test_a_reference_that_no_vehicle_flies_is_not_flown() -> None:
    bench = Bench()
    bench.send(standing())
    bench.start()
    wild = standing()
    wild["acceleration_w"][0, 1] = 6.0
    bench.send(wild)
    bench.run(0.1)
    assert bench.machine.aborted == (
        "the reference asks for acceleration = 6.00 m/s²; allowed 4.00 "
        "(behavior.trajectory_acceleration_max)"
    )
    assert np.abs(bench.reference["acceleration_w"]).max() < 1e-9


def compilations() -> int:
    return len(survey.signatures)  # type: ignore[attr-defined]  # numba's dispatcher


def test_a_reference_that_silence_would_make_too_much_is_not_flown() -> None:
    """Within every limit at its own time; extrapolated, its jerk makes 4.4 m/s² of it in 0.2 s."""
    bench = Bench()
    bench.send(standing())
    bench.start()
    before = compilations()
    wild = standing()
    wild["jerk_w"][0, 1] = 22.0
    bench.send(wild)
    bench.run(0.1)
    assert "the reference asks for acceleration = 4.4" in bench.machine.aborted
    assert compilations() == before, "it was compiled in flight"


@pytest.mark.parametrize(
    ("age", "said"),
    [(None, "no reference was received"), (0.3, "is 0.30 s old"), (-0.3, "is -0.30 s old")],
)
def test_it_starts_with_a_fresh_reference_alone(age: float | None, said: str) -> None:
    bench = Bench()
    if age is not None:
        bench.send(standing(), age)
    with pytest.raises(RefusedError, match=f"external refused: .*{said}") as refused:
        bench.start()
    assert refused.value.kind == Refusal.NO_REFERENCE


def test_the_yaw_may_have_turned_whole_times() -> None:
    bench = Bench()
    bench.send(standing(yaw=4.0 * math.pi + 0.1))
    bench.start()
    bench.run(0.1)
    assert bench.machine.name is BehaviorName.EXTERNAL
    assert bench.reference["yaw"][0] == pytest.approx(4.0 * math.pi + 0.1)


@pytest.mark.parametrize("next_one", ["hover", "land", "brake", "velocity", "fly_to"])
def test_a_person_takes_over_at_any_moment(next_one: str) -> None:
    bench = Bench(RADIUS)
    begin = bench.time
    bench.send(circle(begin, begin))
    bench.start()
    bench.run(1.0, lambda t: circle(t, begin))
    arguments = {"x": 0.0, "y": 0.0, "z": 1.0} if next_one == "fly_to" else {}
    bench.machine.request(next_one, arguments, bench.state, True, True)
    assert bench.machine.name.name.lower() == ("brake" if next_one == "hover" else next_one)
    bench.run(0.5, lambda t: circle(t, begin))
    assert bench.machine.name is not BehaviorName.EXTERNAL
