"""Bad input of `quadlab fly formation`, shapes, messages and the bearing sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.formations.messages import Message
from extensions.formations.options import FormationOptions
from extensions.formations.shape import shape_of
from extensions.formations.suspicion import LIMIT, PAIRS_MIN, TOGETHER_NS, Suspicion
from extensions.formations.tests.flock import Flock
from quadlab.__main__ import main

SQUARE = "1 2 0 0; 2 3 90 0; 3 4 180 0; 4 1 -90 0"
CONTRADICTING = (
    "1 2 0 0; 2 1 180 0; 2 3 90 0; 3 2 -90 0; 3 4 180 0; 4 3 0 0; 4 1 -90 0; "
    "1 4 90 0; 1 3 45 0; 3 1 -135 0; 2 4 115 0; 4 2 -65 0"
)
"""A square with a diagonal that is turned by 20 deg."""


@pytest.mark.parametrize(
    ("count", "words", "line"),
    [
        (1, [], "formation is flown by several vehicles together; add --vehicles 3"),
        (2, [], "--vehicles 2: formation is flown by 3 to 8 vehicles"),
        (
            4,
            [f"experiment.desired={SQUARE}"],
            "experiment.desired: the formation is not rigid; it lacks quad",
        ),
        (4, [f"experiment.desired={CONTRADICTING}"], "° rms; worst is quad"),
        (
            3,
            ["experiment.desired=1 5 0 0"],
            "experiment.desired: '1 5 0 0' is about vehicle 5; there are 1 to 3",
        ),
        (
            3,
            ["experiment.desired=1 2 north"],
            "experiment.desired: '1 2 north' is no bearing; write 'observer observed azimuth",
        ),
        (3, ["experiment.desired=1 2 nan 0"], "'1 2 nan 0' is no bearing"),
        (3, ["experiment.desired=1 2 inf 0"], "'1 2 inf 0' is no bearing"),
        (3, ["experiment.desired=2 2 0 0"], "'2 2 0 0' is of a vehicle to itself; leave it out"),
        (3, ["experiment.desired=1 2 0 0; 1 2 9 0"], "'1 2 9 0' is given already; leave it out"),
        (4, ["experiment.fails=5"], "experiment.fails=5: there are vehicles 1 to 4"),
        (4, ["experiment.joins=6"], "experiment.joins=6: there are vehicles 1 to 4"),
        (0, [], "--vehicles 0"),
        (1000, [], "--vehicles 1000"),
        (
            3,
            ["simulator.start_x=0", "simulator.start_y=0"],
            "quad1 and quad2 would start 0.00 m apart",
        ),
    ],
)
def test_what_cannot_be_flown_is_one_line(
    count: int, words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    sets = [one for word in words for one in ("--set", word)]
    assert main(["fly", "formation", "--vehicles", str(count), *sets]) == 2
    told = capsys.readouterr().err.strip()
    assert line in told
    assert "\n" not in told


def test_the_formation_of_all_is_rigid_with_a_centroid_and_unit_distance() -> None:
    for count in range(3, 9):
        shape = shape_of("", count)
        every = frozenset(range(count))
        assert shape.eigenvalue(frozenset(shape.desired), every) > 0.1, count
        assert shape.places.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        i, j = np.triu_indices(count, 1)
        apart = np.linalg.norm(shape.places[i] - shape.places[j], axis=1)
        assert apart.mean() == pytest.approx(1.0)
        assert apart.min() > 0.5


def test_a_message_has_47_bytes_of_five_vehicles_and_no_position() -> None:
    bearing = (0.6, -0.8 * math.cos(0.3), 0.8 * math.sin(0.3))
    message = Message(1_234_567_890, 0.25, 1.5, dict.fromkeys((0, 1, 2, 4), bearing))
    data = message.encode()
    assert len(data) == 47
    again = Message.decode(data)
    assert (again.stamp_ns, again.yaw, again.distance) == (1_234_567_890, 0.25, 1.5)
    assert again.bearings_y.keys() == {0, 1, 2, 4}
    for one in again.bearings_y.values():
        assert one == pytest.approx(bearing, abs=1e-4)
        assert math.hypot(*one) == pytest.approx(1.0, abs=1e-12)


def test_a_vehicle_between_hides_the_one_behind_it() -> None:
    options = [FormationOptions().model_copy(deep=True) for _ in range(3)]
    line = np.array([[0.0, 0.0, 1.0], [1.5, 0.0, 1.0], [3.0, 0.0, 1.0]])
    for occlusion, seen in ((True, {1}), (False, {1, 2})):
        for one in options:
            one.occlusion = occlusion
        flock = Flock(options, line, np.zeros(3))
        for pilot in flock.pilots:
            pilot.radio.mute = True  # nobody moves
        flock.fly(0.2)
        assert flock.pilots[0]._newest[0].bearings_y.keys() == seen
        assert flock.pilots[1]._newest[1].bearings_y.keys() == {0, 2}


def test_of_two_vehicles_that_contradict_each_other_none_is_suspected() -> None:
    suspicion, random = Suspicion(), np.random.Generator(np.random.PCG64(1))

    def message(other: int, azimuth: float) -> Message:
        at = azimuth + float(random.normal(0.0, 0.026))
        return Message(0, 0.0, 0.0, {other: (math.cos(at), math.sin(at), 0.0)})

    for turned in (0.0, 3.0 * LIMIT):
        for _ in range(2 * PAIRS_MIN):
            suspicion.note(0, {0: message(1, turned), 1: message(0, math.pi)})
        assert suspicion.worst() is None


def test_the_last_bearings_of_a_silent_vehicle_are_not_compared() -> None:
    for age_ns, suspect in ((0, 2), (10 * TOGETHER_NS, None)):
        suspicion = Suspicion()
        turned = (math.cos(0.3), math.sin(0.3), 0.0)
        silent = Message(-age_ns, 0.0, 0.0, {0: turned, 1: turned})
        for _ in range(2 * PAIRS_MIN):
            first = Message(0, 0.0, 0.0, {1: (1.0, 0.0, 0.0), 2: (-1.0, 0.0, 0.0)})
            second = Message(0, 0.0, 0.0, {0: (-1.0, 0.0, 0.0), 2: (-1.0, 0.0, 0.0)})
            for k in (0, 1):
                suspicion.note(k, {0: first, 1: second, 2: silent})
        assert suspicion.worst() == suspect
