"""Edges that fade at the border of view and range, and a formation that slows down for lack."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from bearing_sim.bearing_parameters import BearingParameters
from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.options import FormationOptions
from extensions.formations.shape import FACING, FACING_PLACES
from extensions.formations.starts import APART, starts_near
from extensions.formations.tests.flock import Flock
from extensions.formations.verdict import outside
from extensions.formations.view import View
from quadlab.__main__ import main

AHEAD = {"field_of_view": 90.0, "mount_pitch": -90.0}
"""A sensor of 90 deg that looks along the body's x axis."""


def _facing(**values: float) -> Flock:
    count, random = len(FACING_PLACES), np.random.Generator(np.random.PCG64(1))
    options = [FormationOptions(desired=FACING).model_copy(deep=True) for _ in range(count)]
    for one in options:
        for name, value in AHEAD.items():
            setattr(one.bearings, name, value)
        for name, value in values.items():
            setattr(one, name, value)
    shape = Flock(options, np.eye(count, 3), np.zeros(count)).shape
    places = np.hstack(
        [np.array(starts_near(shape.places, 1, 0.2)), random.uniform(0.9, 1.5, (count, 1))]
    )
    flock = Flock(options, places, shape.yaws + random.uniform(-0.15, 0.15, count))
    flock.begin()
    return flock


def test_an_edge_fades_before_it_leaves_the_field_of_view() -> None:
    view = View(BearingParameters(field_of_view=90.0, mount_pitch=-90.0))
    at = [view.weight(_azimuth(deg), 2.0) for deg in (0.0, 34.0, 36.0, 40.0, 44.0, 45.0, 90.0)]
    assert at[:2] == pytest.approx([1.0, 1.0], abs=1e-9)
    assert at[3] == pytest.approx(0.5)
    assert all(one >= other for one, other in pairwise(at))
    assert at[-2:] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert View(BearingParameters()).weight(_azimuth(180.0), 2.0) == 1.0


def test_an_edge_fades_before_it_leaves_the_range() -> None:
    view = View(BearingParameters(range_max=4.0))
    weights = [view.weight((1.0, 0.0, 0.0), distance) for distance in (0.0, 3.3, 3.7, 4.0, 5.0)]
    assert weights == pytest.approx([1.0, 1.0, 0.5, 0.0, 0.0])


def test_a_field_of_view_of_90_deg_holds_five_that_face_each_other_and_are_steered() -> None:
    flock = _facing()
    before = flock.error()
    assert before > 5.0
    flock.fly(6.0)
    assert flock.error() < 1.5
    start = flock.places.mean(axis=0)
    for pilot in flock.pilots:
        pilot.command = NullMotion((0.4, 0.0, 0.0), 0.1, 0.02)
    flock.fly(2.0)
    assert np.linalg.norm(flock.places.mean(axis=0) - start) == pytest.approx(0.8, abs=0.15)
    assert flock.error() < 2.5
    assert min(pilot.least for pilot in flock.pilots) > FormationOptions().eigenvalue_min
    assert flock.nearest > 0.8


def test_a_formation_that_is_hardly_rigid_slows_down_and_says_so() -> None:
    flock = _facing(eigenvalue_min=1.0)
    flock.fly(1.0)
    before = flock.places.mean(axis=0)
    for pilot in flock.pilots:
        pilot.command = NullMotion((0.5, 0.0, 0.0))
    flock.fly(1.0)
    assert np.linalg.norm(flock.places.mean(axis=0) - before) < 0.1
    for here in flock.all:
        assert len(here.events) == 1
        assert here.events[0].startswith("formation: it slows down; its rigidity eigenvalue is 0.")
        assert here.events[0].endswith(", the bound 1")


def test_starts_near_the_formation_are_apart() -> None:
    starts = np.array(starts_near(FACING_PLACES, 3, 0.3))
    i, j = np.triu_indices(len(starts), 1)
    assert np.linalg.norm(starts[i] - starts[j], axis=1).min() >= APART - 0.25
    assert (starts != np.array(starts_near(FACING_PLACES, 4, 0.3))).all()


def test_the_facing_formation_is_of_five(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", "formation", "--vehicles", "4", "--set", "experiment.desired=facing"]) == 2
    told = capsys.readouterr().err.strip()
    assert "experiment.desired=facing is of 5 vehicles, not of 4: fly so many" in told
    assert "\n" not in told


def test_a_place_outside_the_volume_counts_by_how_far() -> None:
    assert outside(np.array([[[0.0, 0.0, 1.0], [3.9, -3.9, 2.9]]])) == 0.0
    assert outside(np.array([[[0.0, 0.0, 1.0], [4.3, 0.0, 1.0]]])) == pytest.approx(0.3)
    assert outside(np.array([[[0.0, 0.0, 0.1], [0.0, 0.0, 1.0]]])) == pytest.approx(0.1)


def _azimuth(deg: float) -> tuple[float, float, float]:
    return math.cos(math.radians(deg)), math.sin(math.radians(deg)), 0.0
