"""The formation's law: what its docstring says to hold, and many flights of point vehicles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.formations.mathematics.law import Gains, formation_velocity, relative_yaw
from extensions.formations.mathematics.realisation import desired_places
from extensions.formations.mathematics.rigidity import bearings, rigidity_matrix, yaw_rotation
from extensions.formations.mathematics.steering import (
    NullMotion,
    edge_weight,
    separated_velocity,
    steering_pace,
    steering_velocity,
)
from extensions.formations.tests.mathematics.kinematic import (
    DT,
    SIGMA,
    Flight,
    Network,
    Steering,
    complete,
    random_flights,
    ring,
    scattered,
)
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

QUICK = Gains(speed_limit=1e3, yaw_rate_limit=1e3)


def velocities(flight: Flight, s: int, gains: Gains) -> tuple[Array, Array]:
    """Return the world velocities and yaw rates of the vehicles' own calls of the law."""
    edges = [(int(i), int(j)) for i, j in flight.edges]
    beta = dict(zip(edges, flight.true_bearings()[s], strict=True))
    desired = dict(zip(edges, flight.wanted[s], strict=True))
    n, yaws = flight.yaws.shape[1], flight.yaws[s]
    moves, turns = np.zeros((n, 3)), np.zeros(n)
    for i in range(n):
        seen = {j: b for (a, j), b in beta.items() if a == i}
        seen_by = {a: (b, float(yaws[i] - yaws[a])) for (a, j), b in beta.items() if j == i}
        velocity_y, turns[i] = formation_velocity(i, seen, seen_by, desired, gains)
        moves[i] = yaw_rotation(yaws[i]) @ velocity_y
    return moves, turns


def flown(flight: Flight, seconds: float) -> Array:
    """Return the bearing errors (frames, S) in degrees."""
    errors = []
    for _ in range(round(seconds / DT)):
        flight.step()
        errors.append(flight.error())
    return np.array(errors)


def size(flight: Flight) -> Array:
    i, j = np.triu_indices(flight.yaws.shape[1], 1)
    apart = np.linalg.norm(flight.places_w[:, i] - flight.places_w[:, j], axis=-1)
    return np.asarray(apart.mean(axis=1))


def test_centroid_and_scale_stay_and_the_distance_to_the_shape_falls() -> None:
    flight = random_flights(6, range(20))
    for s in range(20):
        moves, _ = velocities(flight, s, QUICK)
        away = flight.places_w[s] - flight.places_w[s].mean(axis=0)
        np.testing.assert_allclose(moves.sum(axis=0), 0.0, atol=1e-12)
        assert np.vdot(away, moves) == pytest.approx(0.0, abs=1e-12)
        # With the yaws right, toward the shape of the same centroid and scale.
        shape, turns = desired_places(flight.wanted[s], flight.edges, 6)
        turns = turns + 0.7
        flight.yaws[s] = turns
        target = np.einsum("nab,nb->na", yaw_rotation(turns), shape)
        target *= np.linalg.norm(away) / np.linalg.norm(target)
        moves, rates = velocities(flight, s, QUICK)
        assert np.vdot(away - target, moves) < 0.0
        np.testing.assert_allclose(rates, 0.0, atol=1e-6)


def test_nothing_moves_at_the_desired_bearings() -> None:
    flight = random_flights(5, range(5), near=True)
    for s in range(5):
        moves, rates = velocities(flight, s, QUICK)
        np.testing.assert_allclose(moves, 0.0, atol=1e-12)
        np.testing.assert_allclose(rates, 0.0, atol=1e-12)


def test_the_flights_below_fly_the_law() -> None:
    flight = random_flights(5, range(3), Network(sigma=0.0))
    beta = flight.true_bearings()
    there = np.ones(beta.shape[:2], dtype=bool)
    moves, rates = flight.rates(beta, there, beta, there)
    for s in range(3):
        expected, turns = velocities(flight, s, flight.gains)
        world = np.einsum("nab,nb->na", yaw_rotation(flight.yaws[s]), moves[s])
        np.testing.assert_allclose(world, expected, atol=1e-12)
        np.testing.assert_allclose(rates[s], turns, atol=1e-12)


def test_204_random_starts_of_3_to_8_vehicles_converge() -> None:
    for n in range(3, 9):
        errors = flown(random_flights(n, range(34)), 30.0)
        steady = np.sqrt(np.mean(errors[-150:] ** 2, axis=0))
        assert (steady <= 1.0).all(), n


@pytest.mark.parametrize(("loss", "delay"), [(0.1, 0.0), (0.3, 0.0), (0.6, 0.0), (0.0, 0.2)])
def test_it_converges_with_messages_lost_or_late(loss: float, delay: float) -> None:
    errors = flown(random_flights(5, range(20), Network(loss=loss, delay=delay)), 20.0)
    assert (np.sqrt(np.mean(errors[-90:] ** 2, axis=0)) <= 1.0).all()


def test_a_steered_formation_keeps_its_bearings() -> None:
    flight = random_flights(5, range(8), near=True)
    steering, errors = Steering(flight), []
    for k in range(round(60.0 / DT)):
        flight.step(steering.feed((0.5, 0.0, 0.0), 0.3, 0.1 if k // 150 % 2 == 0 else -0.1))
        errors.append(flight.error())
    assert np.sqrt(np.mean(np.square(errors), axis=0)).max() <= 2.5


def test_edges_that_leave_the_view_and_return_do_no_harm() -> None:
    edges, places, yaws = ring(7)
    rng, S = np.random.default_rng(5), 6
    flight = Flight(
        edges,
        np.tile(bearings(places, yaws, edges), (S, 1, 1)),
        places + 0.2 * rng.normal(size=(S, 7, 3)),
        yaws + rng.uniform(-0.5, 0.5, (S, 7)),
        rng,
        Network(half_angle=math.radians(45.0)),
        Gains(bearing=2.0, sigma=SIGMA),
    )
    number, paces, errors = set(), [], []
    steering = Steering(flight, bound=0.3)
    for k in range(round(30.0 / DT)):
        flight.lost[:] = (rng.uniform(size=flight.lost.shape) < 0.5) & (300 <= k < 600)
        flight.step(steering.feed((0.5, 0.0, 0.0), 0.3, 0.0) if k % 10 == 0 else None)
        number.add(int(flight.seen().sum()))
        errors.append(flight.error())
        if k % 30 == 0:
            paces.append(steering.pace())
    assert len(number) > 20
    assert np.mean(paces[10:20]) < 0.05  # of what is commanded while edges are missing
    assert np.mean(paces[25:]) > 0.5
    assert np.array(errors)[-60:].max() <= 1.0


def test_noise_does_not_inflate_the_formation() -> None:
    """A formation with compasses keeps its size; from bearings alone a known part remains."""
    grown = {}
    for sigma, compass in ((0.0, True), (SIGMA, True), (SIGMA, False)):
        flight = random_flights(5, range(8), Network(compass=compass), near=True)
        flight.gains = Gains(sigma=sigma)
        before = size(flight)
        flown(flight, 30.0)
        grown[sigma, compass] = float((size(flight) / before).mean()) - 1.0
    assert grown[0.0, True] > 0.03
    assert abs(grown[SIGMA, True]) < 0.003
    assert -0.03 < grown[SIGMA, False] < 0.0


def test_relative_yaw_of_two_that_see_each_other() -> None:
    rng = np.random.default_rng(6)
    for _ in range(20):
        p, yaws = scattered(rng, 2), rng.uniform(-3, 3, 2)
        mine, theirs = bearings(p, yaws, [(0, 1), (1, 0)])
        found = relative_yaw(mine, theirs)
        assert found is not None
        assert math.remainder(found - (yaws[0] - yaws[1]), 2 * math.pi) == pytest.approx(0.0)
    assert relative_yaw([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]) is None


def test_a_vehicle_whose_own_bearings_are_not_in_use_turns_by_the_yaws_that_it_is_told() -> None:
    seen_by = {1: ((-1.0, 0.0, 0.0), 0.3), 2: ((0.0, -1.0, 0.0), 0.3)}
    desired = {(1, 0): (-1.0, 0.0, 0.0), (2, 0): (0.0, -1.0, 0.0)}
    _, still = formation_velocity(0, {}, seen_by, desired, Gains())
    assert still == 0.0
    _, rate = formation_velocity(0, {}, seen_by, desired, Gains(), yaws=[0.1, 0.0, 0.0])
    assert rate == pytest.approx(math.sin(0.1 - 0.3))


def test_commanded_motions_change_no_bearing() -> None:
    rng = np.random.default_rng(7)
    p, yaws, edges = scattered(rng, 5), rng.uniform(-3, 3, 5), complete(5)
    command = NullMotion((0.4, -0.2, 0.1), 0.3, 0.1)
    moves = np.zeros((5, 4))
    for k in range(5):
        place_y = yaw_rotation(-yaws[k]) @ (p[k] - p.mean(axis=0))
        velocity_y, moves[k, 3] = steering_velocity(command, place_y, float(yaws[k] - yaws[0]))
        moves[k, :3] = yaw_rotation(yaws[k]) @ velocity_y
    np.testing.assert_allclose(rigidity_matrix(p, yaws, edges) @ moves.ravel(), 0.0, atol=1e-12)
    np.testing.assert_allclose(
        moves[:, :3].mean(axis=0), yaw_rotation(yaws[0]) @ command.velocity_y, atol=1e-12
    )


def test_pace_and_weight_fall_smoothly_to_zero() -> None:
    assert [steering_pace(x, 0.1) for x in (0.0, 0.1, 0.15, 0.2, 1.0)] == [
        0.0, 0.0, pytest.approx(0.5), 1.0, 1.0,
    ]  # fmt: skip
    at = [
        edge_weight([math.cos(a), math.sin(a), 0.0], [1.0, 0.0, 0.0], 0.8, 0.2)
        for a in (0.0, 0.6, 0.7, 0.8, 1.0)
    ]
    assert at == [1.0, pytest.approx(1.0), pytest.approx(0.5), pytest.approx(0.0, abs=1e-9), 0.0]


def test_vehicles_that_fly_into_each_other_stay_apart() -> None:
    rng = np.random.default_rng(8)
    p = scattered(rng, 6, least=1.0)
    for _ in range(150):
        wanted = -2.0 * p  # all to one point
        moves = [
            separated_velocity(wanted[k], np.delete(p, k, axis=0) - p[k], 0.8) for k in range(6)
        ]
        p = p + DT * np.array(moves)
        i, j = np.triu_indices(6, 1)
        assert np.linalg.norm(p[i] - p[j], axis=1).min() > 0.79


def test_what_is_no_bearing_and_no_gain_is_told() -> None:
    x = [1.0, 0.0, 0.0]
    with pytest.raises(DegenerateGeometryError, match=r"edge \(0, 1\) is no unit vector"):
        formation_velocity(0, {1: [0.0, 0.0, 0.0]}, {}, {(0, 1): x}, Gains())
    with pytest.raises(ValueError, match="the gain bearing is 0"):
        Gains(bearing=0.0)
    # A neighbour that nobody desired, and one that is not seen.
    velocity, rate = formation_velocity(0, {2: x}, {}, {(0, 1): x, (1, 0): x}, Gains())
    np.testing.assert_array_equal(velocity, 0.0)
    assert rate == 0.0
