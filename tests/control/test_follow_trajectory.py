"""Behavior follow_trajectory: every trajectory by name, checked before it starts."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.behaviors.behavior import Context, argument_descriptions
from control.behaviors.follow_trajectory import FollowTrajectory, limits_of
from control.behaviors.machine import BEHAVIORS, BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from control.behaviors.trajectory_arguments import TRAJECTORIES
from control.behaviors.trajectory_choice import CHOICES
from control.behaviors.way_points import read_waypoints
from control.trajectories.feasibility import examine
from control.trajectories.minimum_snap import minimum_snap
from control.trajectories.trajectory import Trajectory, sample_many
from quadrotor.errors import (
    OutOfBoundsError,
    ParameterError,
    RefusedError,
    UnknownParameterError,
    WrongTypeError,
)
from quadrotor.records import Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel

LOOP = minimum_snap(
    np.array(
        [[0.5, 0.5, 1, 0.2], [-0.5, 0.5, 1.3, 0.5], [0.0, -0.5, 1.0, 0.0], [0.5, 0.5, 1, 0.2]]
    ),
    np.array([0.0, 3.0, 6.0, 9.0]),
)


def context(
    x: float = 0.0,
    y: float = 0.0,
    z: float = 1.2,
    yaw: float = 0.3,
    model: Record | None = None,
    **changes: Any,
) -> Context:
    reference = new_reference()
    reference["position_w"], reference["yaw"] = (x, y, z), yaw
    return Context(
        reference,
        BehaviorParameters(**changes),
        12.8,
        VehicleModel().record() if model is None else model,
        {"loop": LOOP},
    )


DEFAULTS: dict[str, dict[str, float | str]] = {
    "figure_eight": {},
    "figure_eight_lap": {"period": 10.0},
    "circle": {"nose": "tangent"},
    "helix": {"nose": "center", "side": "right"},
    "line": {"x": 1.0, "yaw": 2.0},
    "waypoints": {"waypoints": "1 0 1.5 1; 1 1 1.2; 0, 0, 1, -1"},
    "file": {"file": "loop", "anchor": "here"},
}


def path_of(behavior: FollowTrajectory, count: int = 2001) -> Record:
    out = []
    reference = new_reference()
    for t in np.linspace(0.0, behavior._duration, count):
        behavior._sample(float(t), reference)
        out.append(reference.copy())
    return np.concatenate(out)


@pytest.mark.parametrize("name", TRAJECTORIES)
def test_each_starts_at_the_present_reference_and_rests_at_both_ends(name: str) -> None:
    c = context()
    behavior = FollowTrajectory.start(c, {"trajectory": name, **DEFAULTS[name]})
    path = path_of(behavior)
    np.testing.assert_allclose(path["position_w"][0], [0.0, 0.0, 1.2], atol=1e-9)
    assert path["yaw"][0] == pytest.approx(0.3)
    for field in ("velocity_w", "acceleration_w", "jerk_w", "snap_w", "yaw_rate"):
        np.testing.assert_allclose(path[field][[0, -1]], 0.0, atol=1e-6)
    assert behavior.report.feasible
    assert np.ptp(path["position_w"], axis=0).max() > 0.4


def test_every_trajectory_is_offered_and_described() -> None:
    assert tuple(CHOICES) == TRAJECTORIES
    form = argument_descriptions(BEHAVIORS[BehaviorName.FOLLOW_TRAJECTORY].arguments)
    assert next(iter(form)) == "trajectory"
    for name, choice in CHOICES.items():
        for argument, description in argument_descriptions(choice.arguments).items():
            assert form[argument] == description
            if argument != "trajectory":
                assert name in description.description.split(":")[0].split(", ")


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"trajectory": "spiral"}, OutOfBoundsError, "'spiral' is not one of figure_eight, "),
        ({"radius": 1.0}, UnknownParameterError, "figure_eight takes no radius: it takes traj"),
        ({"trajectory": "line", "laps": 2}, UnknownParameterError, "line takes no laps: it takes"),
        ({"radios": 1.0}, UnknownParameterError, "no argument 'radios'"),
        ({"trajectory": "circle", "nose": "up"}, OutOfBoundsError, "'up' is not one of fixed"),
        ({"trajectory": "circle", "laps": 1, "ramp": 9.0}, OutOfBoundsError, "ramp = 9 s does"),
        ({"trajectory": "helix", "radius": 0.0}, OutOfBoundsError, "allowed 0.05 to 20 m"),
        ({"trajectory": "line", "jerk": float("nan")}, OutOfBoundsError, "not a finite number"),
        ({"trajectory": "waypoints"}, OutOfBoundsError, "has 0 points; allowed 1 to 12"),
        ({"trajectory": "waypoints", "waypoints": "1 1"}, WrongTypeError, "point 1: 2 numbers"),
        ({"trajectory": "waypoints", "waypoints": "1 1 1;1 b 1"}, WrongTypeError, "point 2: 'b'"),
        ({"trajectory": "waypoints", "waypoints": "1 1 nan"}, OutOfBoundsError, "point 1: nan"),
        (
            {"trajectory": "waypoints", "waypoints": "1 1 1;1 1 1"},
            OutOfBoundsError,
            "point 2 is where",
        ),
        ({"trajectory": "waypoints", "waypoints": "1 1 1;" * 13}, OutOfBoundsError, "has 13 poi"),
        ({"trajectory": "file", "file": "lop"}, OutOfBoundsError, "'lop' is not loaded; .* loop"),
        ({"trajectory": "file", "file": "loop"}, RefusedError, r"starts at x = 0.500, y = 0.500"),
    ],
)
def test_wrong_arguments_are_refused_with_what_is_allowed(
    arguments: Mapping[str, float | str], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        FollowTrajectory.start(context(), arguments)


LIMITS = [
    ("trajectory_speed_max", 0.5, "speed"),
    ("trajectory_acceleration_max", 0.5, "acceleration"),
    ("yaw_rate_max", 0.5, "yaw rate"),
    ("yaw_acceleration_max", 0.3, "yaw acceleration"),
    ("trajectory_tilt_max", 5.0, "tilt"),
    ("trajectory_thrust_margin", 0.45, "motor thrust"),
    ("trajectory_body_rate_max", 0.6, "body rate"),
    ("trajectory_yaw_torque_max", 0.01, "yaw torque"),
]


@pytest.mark.parametrize(("parameter", "value", "what"), LIMITS)
def test_every_limit_refuses_the_eight_and_proposes_a_period_that_flies(
    parameter: str, value: float, what: str
) -> None:
    FollowTrajectory.start(context(), {})
    tight = context(model=None, **{parameter: value})
    with pytest.raises(RefusedError, match=f"its .*{what} reaches") as refused:
        FollowTrajectory.start(tight, {})
    text = str(refused.value)
    assert f"behavior.{parameter}" in text
    assert "s on); allowed" in text
    period = float(text.split("try a period of ")[1].split(maxsplit=1)[0])
    FollowTrajectory.start(tight, {"period": period})
    # Not needlessly slow either: the search stops within a few per cent.
    with pytest.raises(RefusedError):
        FollowTrajectory.start(tight, {"period": 0.93 * period})


@pytest.mark.parametrize(
    "arguments",
    [
        {"trajectory": "circle", "period": 2.5},
        {"trajectory": "helix", "period": 2.5, "nose": "tangent"},
        {"trajectory": "figure_eight_lap", "period": 6.0},
        {"trajectory": "line", "x": 2.5, "speed": 4.0, "acceleration": 7.0, "jerk": 90.0},
        {
            "trajectory": "waypoints",
            "waypoints": "2 0 1;2 2 1;0 0 1",
            "speed": 4.0,
            "acceleration": 7.0,
        },
        {"trajectory": "file", "file": "loop", "anchor": "here", "time_factor": 0.3},
    ],
)
def test_the_slower_pace_that_a_refusal_proposes_flies(arguments: dict[str, float | str]) -> None:
    c = context()
    with pytest.raises(RefusedError, match=r"; try an? ") as refused:
        FollowTrajectory.start(c, arguments)
    proposed = dict(arguments)
    for words in str(refused.value).split("; try ")[1].split(" and "):
        _, name, _, value = words.split()[:4]
        proposed[name] = float(value)
    assert proposed != arguments
    FollowTrajectory.start(c, proposed)


def test_a_wall_is_refused_by_its_name_and_time() -> None:
    with pytest.raises(
        RefusedError, match=r"x = 2.00 m is outside .* from \d.\d\d s on"
    ) as refused:
        FollowTrajectory.start(context(volume_x_max=1.5), {"trajectory": "line", "x": 2.0})
    assert "allowed -3 to 1.5 m (behavior.volume_x_min, behavior.volume_x_max)" in str(
        refused.value
    )


def test_no_pace_helps_where_hovering_is_too_much() -> None:
    heavy = VehicleModel(mass=2.2).record()
    tight = context(model=heavy, trajectory_thrust_margin=0.2)
    with pytest.raises(RefusedError, match=r"largest motor thrust .*; no slower pace helps"):
        FollowTrajectory.start(tight, {})


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(("figure_eight", "figure_eight_lap", "circle", "helix")),
    st.floats(2.0, 20.0),
    st.floats(0.5, 6.0),
    st.floats(0.2, 2.0),
)
def test_what_is_accepted_keeps_to_every_limit_and_what_is_refused_does_not(
    name: str, period: float, ramp: float, size: float
) -> None:
    c = context()
    given_: dict[str, float | str] = {"trajectory": name, "period": period}
    given_ |= {"width": size, "height": size} if "eight" in name else {"radius": size}
    given_ |= {} if name.endswith("lap") else {"ramp": ramp}
    limits = limits_of(c.parameters, c.model)
    made = CHOICES[name].make(c, CHOICES[name].arguments.model_validate(given_))
    dense = Plain(made)
    feasible = examine(dense, c.model, limits).feasible
    try:
        FollowTrajectory.start(c, given_)
        started = True
    except RefusedError:
        started = False
    assert started == feasible


class Plain:
    """All of a trajectory, at 100 Hz, without the shortcut for repetitions."""

    def __init__(self, path: Trajectory) -> None:
        self.duration, self.sample = path.duration, path.sample


def test_the_model_decides() -> None:
    arguments = {"period": 4.8}
    FollowTrajectory.start(context(), arguments)
    heavy = VehicleModel(mass=2.1).record()
    with pytest.raises(RefusedError, match="largest motor thrust reaches"):
        FollowTrajectory.start(context(model=heavy), arguments)


def test_the_machine_checks_by_its_model_and_flies_its_files() -> None:
    machine = BehaviorMachine(BehaviorParameters(), trajectories={"loop": LOOP})
    state, reference = new_state(), new_reference()
    machine.request("take_off", {"height": 1.0}, state, True, True)

    def run(seconds: float) -> None:
        for _ in range(round(seconds / 0.002)):
            machine.step(0, 0.002, state, None, 12.8, reference)

    run(6.0)
    wanted = {"trajectory": "file", "file": "loop"}
    with pytest.raises(RefusedError, match="fly_to there first"):
        machine.request("follow_trajectory", wanted, state, True, True)
    goal = {"x": 0.5, "y": 0.5, "z": 1.0, "yaw": 0.2}
    machine.request("fly_to", goal, state, True, True)
    run(5.0)
    machine.model = VehicleModel(inertia_xx=0.1).record()
    machine.model["thrust_max"] = 3.3
    with pytest.raises(RefusedError, match="motor thrust"):
        machine.request("follow_trajectory", wanted, state, True, True)
    assert machine.name is BehaviorName.HOVER
    machine.model = VehicleModel().record()
    machine.request("follow_trajectory", wanted, state, True, True)
    run(3.0)
    at = sample_many(LOOP, np.array([3.0]))
    np.testing.assert_allclose(reference["position_w"], at["position_w"], atol=1e-6)
    run(6.1)
    assert machine.name is BehaviorName.HOVER


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(*([st.floats(-50, 50)] * 3), st.one_of(st.none(), st.floats(-6, 6))),
        min_size=1,
        max_size=12,
    )
)
def test_way_points_read_what_was_written(
    points: list[tuple[float, float, float, None] | tuple[float, float, float, float]]
    | list[tuple[float, float, float, None]]
    | list[tuple[float, float, float, float]],
) -> None:
    start = (0.0, 60.0, 0.0, 1.0)
    text = "; ".join(" ".join(repr(v) for v in point if v is not None) for point in points)
    try:
        read = read_waypoints(text, start)
    except ParameterError:
        assert (
            len({p[:3] for p in points}) < len(points)
            or min(np.linalg.norm(np.subtract(a[:3], b[:3])) for a, b in itertools.pairwise(points))
            < 1e-3
        )
        return
    np.testing.assert_array_equal(read[1:, :3], [p[:3] for p in points])
    assert (np.abs(np.diff(read[:, 3])) <= np.pi + 1e-9).all()
    yaw = 1.0
    for row, point in zip(read[1:], points, strict=True):
        yaw = yaw if point[3] is None else point[3]
        assert np.cos(row[3] - yaw) == pytest.approx(1.0)
