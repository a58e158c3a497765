"""Keep-out boxes: their text, where a path meets them, and what the behaviors do before them."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from control.behaviors.behavior import Context, TickInputs
from control.behaviors.excite import Excite
from control.behaviors.external import External
from control.behaviors.fly_to import FlyTo
from control.behaviors.follow_trajectory import FollowTrajectory
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.take_off import TakeOff
from control.behaviors.velocity import set_walls
from control.keep_out import MOST, check_around, first_encounter, format_keep_out, parse_keep_out
from control.trajectories.velocity_filter import advance, new_velocity_filter
from quadrotor.errors import OutOfBoundsError, RefusedError
from quadrotor.records import new_reference

PILLAR = "pillar 1.0 1.5 -0.5 0.5 0.0 1.6"
MARGIN = 0.4
DT = 0.004


def context(x: float, y: float = 0.0, z: float = 1.0, boxes: str = PILLAR) -> Context:
    reference = new_reference()
    reference["position_w"] = (x, y, z)
    return Context(reference, BehaviorParameters(keep_out=boxes), 12.8)


def test_the_text_of_boxes_is_read_and_written_alike() -> None:
    assert parse_keep_out("none") == parse_keep_out(" ") == ()
    text = f"{PILLAR}; net -3.0 3.0 2.0 2.2 0.0 3.0"
    boxes = parse_keep_out(text.replace(" ", ", "))
    assert [box.name for box in boxes] == ["pillar", "net"]
    assert boxes[0].low_w == (1.0, -0.5, 0.0)
    assert boxes[0].high_w == (1.5, 0.5, 1.6)
    assert format_keep_out(boxes) == text
    assert format_keep_out(()) == "none"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("pillar 1 2 3", "'pillar 1 2 3' is not a name with six numbers; give 'name x_min"),
        ("pillar 1 2 a 4 0 1", "is not a name with six numbers"),
        ("pillar 1 2 3 4 0 1 5", "is not a name with six numbers"),
        ("1 1 2 3 4 0 1", "does not begin with a name, like pillar_1"),
        ("pillar 1.5 1 0 1 0 1", "x from 1.5 to 1 m; the first must be below the second"),
        ("pillar 1 2 0 0 0 1", "y from 0 to 0 m"),
        ("pillar 1 2 0 1 nan 1", "z from nan to 1 m; allowed ±100 m"),
        ("pillar 1 inf 0 1 0 1", "x from 1 to inf m; allowed ±100 m"),
        (f"{PILLAR}; {PILLAR}", "two boxes are called pillar; give each its own name"),
        ("; ".join(f"b{k} 0 1 0 1 0 1" for k in range(MOST + 1)), "9 boxes; allowed 8"),
    ],
)
def test_a_wrong_box_is_one_clear_line(text: str, reason: str) -> None:
    with pytest.raises(OutOfBoundsError, match=re.escape(reason)) as caught:
        parse_keep_out(text)
    assert str(caught.value).startswith("behavior.keep_out: ")
    assert "\n" not in str(caught.value)


def test_the_first_place_too_near_is_found_exactly(rng: np.random.Generator) -> None:
    boxes = parse_keep_out(PILLAR)
    found = first_encounter(boxes, [(-1.0, 0.0, 1.0), (0.0, 0.0, 1.0), (2.0, 0.0, 1.0)], MARGIN)
    assert found is not None
    assert found.at == pytest.approx(1.3, abs=1e-5)
    assert found.place_w == pytest.approx((0.6, 0.0, 1.0), abs=1e-5)
    assert first_encounter(boxes, [(-1.0, 0.91, 1.0), (3.0, 0.91, 1.0)], MARGIN) is None
    low, high = np.array(boxes[0].low_w), np.array(boxes[0].high_w)
    for a, b in rng.uniform(-2.0, 3.0, (200, 2, 3)):
        shares = np.linspace(0.0, 1.0, 2001)[:, None]
        points = a + shares * (b - a)
        gaps = np.maximum(low - points, points - high).max(axis=1)
        near = first_encounter(boxes, (a, b), MARGIN)
        if near is None:
            assert gaps.min() > MARGIN - 1e-4
        else:
            assert gaps[shares[:, 0] < near.at - 1e-3].min(initial=9.0) > MARGIN - 1e-4
            assert boxes[0].gap(near.place_w) <= MARGIN + 1e-4


def test_a_path_that_begins_too_near_may_lead_away_but_not_nearer() -> None:
    boxes = parse_keep_out(PILLAR)
    here = (0.8, 0.0, 1.0)
    assert first_encounter(boxes, (here, (-1.0, 0.0, 1.0)), MARGIN) is not None
    assert first_encounter(boxes, (here, (-1.0, 0.0, 1.0)), MARGIN, may_leave=True) is None
    assert first_encounter(boxes, (here, (0.9, 0.0, 1.0)), MARGIN, may_leave=True) is not None


def test_a_new_box_may_not_be_around_the_vehicle_nor_over_its_take_off() -> None:
    new = parse_keep_out(PILLAR)
    inside = r"vehicle at \(1.20, 0.00, 1.00\) m is inside the keep-out box pillar with its 0.40 m"
    with pytest.raises(RefusedError, match=inside):
        check_around(new, MARGIN, (), MARGIN, [(1.2, 0.0, 1.0)])
    check_around(new, MARGIN, new, MARGIN, [(1.2, 0.0, 1.0)])  # it was there
    check_around(new, MARGIN, (), MARGIN, [(0.5, 0.0, 1.0)])
    lamp = parse_keep_out("lamp -1 1 -1 1 0.9 2")
    with pytest.raises(RefusedError, match=r"box lamp with its 0.40 m is above the vehicle at"):
        check_around(lamp, MARGIN, (), MARGIN, [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    check_around(lamp, MARGIN, (), MARGIN, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.4)])


@pytest.mark.parametrize(
    ("start", "given"),
    [
        (FlyTo, {"x": 2.5}),
        (FollowTrajectory, {"trajectory": "waypoints", "waypoints": "2.5 0 1"}),
        (FollowTrajectory, {"trajectory": "circle", "radius": 1.0}),
        (FollowTrajectory, {"trajectory": "line", "x": 2.5, "y": 0.1, "z": 1.0}),
    ],
)
def test_a_path_through_a_box_is_refused_by_name_and_place(start: Any, given: Any) -> None:
    near = r"within 0.40 m of the keep-out box pillar at \(\S+, \S+, \S+\) m"
    with pytest.raises(RefusedError, match=near) as caught:
        start.start(context(0.0), given)
    assert "fly around it, or move or remove the box (behavior.keep_out" in str(caught.value)
    start.start(context(0.0, boxes="none"), given)
    start.start(context(0.0, boxes="far 2 2.5 -3 -2.5 0 1"), given)


def test_a_path_from_a_motion_is_followed_into_the_box() -> None:
    moving = context(-0.4)
    moving.reference["velocity_w"] = (1.0, 0.0, 0.0)
    with pytest.raises(RefusedError, match=r"fly_to refused: it leads within 0\.40 m"):
        FlyTo.start(moving, {"x": 0.55, "y": 0.5})
    FlyTo.start(moving, {"x": -0.5})


def test_a_take_off_or_a_step_under_or_beside_a_box_is_refused() -> None:
    for place in ((1.2, 0.0, 1.9), (0.7, 0.0, 0.0)):
        with pytest.raises(RefusedError, match=r"take_off refused: it leads within 0\.40 m"):
            TakeOff.start(context(*place), {})
    TakeOff.start(context(0.55, 0.0, 0.0), {})
    with pytest.raises(RefusedError, match=r"excite refused: it leads within 0\.40 m"):
        Excite.start(context(0.4), {"axis": "x", "amplitude": 0.3})


def test_a_reference_from_outside_is_flown_only_if_it_could_stop_before_the_box() -> None:
    def start(x: float, speed: float) -> External:
        before = context(x)
        before.reference["velocity_w"] = (speed, 0.0, 0.0)
        before.outside.reference[:] = before.reference
        before.outside.stamp_ns = before.stamp_ns
        return External.start(before, {})

    flown = start(0.0, 0.5)
    with pytest.raises(
        RefusedError, match=r"would stop after it, is within 0.40 m of the keep-out"
    ):
        start(0.2, 1.0)
    reference, tick = flown._outside.reference.copy(), TickInputs(dt=0.02)
    for k in range(1, 100):  # on towards the box
        tick.stamp_ns = flown._outside.stamp_ns = 20_000_000 * k
        flown._outside.reference["position_w"] = (0.01 * k, 0.0, 1.0)
        if flown.step(tick, reference):
            break
    assert "keep-out box pillar" in flown.aborted
    assert 0.2 < reference["position_w"][0, 0] < 0.6


def test_sticks_are_held_before_every_face_and_lead_around_the_box(
    rng: np.random.Generator,
) -> None:
    p = BehaviorParameters(keep_out=f"{PILLAR}; low -1.5 -1.0 -2.0 2.0 0.0 0.4")
    least = [np.inf, np.inf]
    for _ in range(12):
        reference = new_reference()
        reference["position_w"] = (-0.2, rng.uniform(-1.2, 1.2), rng.uniform(1.0, 2.2))
        f = new_velocity_filter(reference, 2.0, 2.0)
        set_walls(f, p)
        for k in range(4000):
            if k % 200 == 0:  # mostly at the box, from everywhere
                towards = np.append((1.25, 0.0, 0.8) - reference["position_w"][0], 0.0)
                f["command"] = np.clip(towards + rng.normal(size=4), -1.2, 1.2) * (1, 1, 1, 0)
            advance(f, DT, reference)
            place = reference["position_w"][0].tolist()
            least = [min(one, box.gap(place)) for one, box in zip(least, p.boxes, strict=True)]
    assert min(least) > MARGIN - 1e-3
    assert least[0] < MARGIN + 0.02, "never came to a face"

    reference = new_reference()
    reference["position_w"] = (-20.0, 0.0, 1.0)
    f = new_velocity_filter(reference, 2.0, 2.0)
    set_walls(f, p.model_copy(update={"keep_out": PILLAR, "volume_x_min": -30.0}))
    f["command"][0, 0] = 5.0
    for _ in range(4000):  # faster than the speed from which the wall's rule alone can stop
        advance(f, DT, reference)
        assert reference["position_w"][0, 0] < 0.6 + 1e-3
    assert reference["position_w"][0, 0] > 0.55

    reference = new_reference()
    reference["position_w"] = (-0.5, 0.0, 1.0)
    f = new_velocity_filter(reference, 2.0, 2.0)
    set_walls(f, p)
    for command, held in [
        ((1.0, 0.0, 0.0), (0.6, 0.0, 1.0)),
        ((1.0, 0.3, 0.0), (2.99, 2.4, 1.0)),  # along the face, then past the corner
    ]:
        f["command"][0, :3] = command
        for _ in range(2500):
            advance(f, DT, reference)
        if held[0] < 1.0:
            assert reference["position_w"][0] == pytest.approx(held, abs=0.01)
    assert reference["position_w"][0, 0] > 2.5
