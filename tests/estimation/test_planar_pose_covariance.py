"""Covariance of a one-frame pose: always available and honest; a bad fit gives none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.poses.frame_solution import FALSE_REFUSAL, chi_square
from estimation.poses.planar_pose import PlanarPose, PlanarPoseSolver
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

SIGMA = math.radians(1.5)
SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])


def ring(count: int) -> Array:
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angle), np.sin(angle), np.full(count, 0.1)])


class Views:
    """Poses (n, 3), attitudes and bearings (n, N, 3) of the envelope, with noise."""

    def __init__(
        self, rng: np.random.Generator, beacons: Array, count: int, low: float, high: float
    ) -> None:
        self.rng = rng
        self.r = np.column_stack(
            [rng.uniform(-1.2, 1.2, (count, 2)), rng.uniform(low, high, count)]
        )
        turns = np.column_stack([rng.uniform(-180, 180, count), rng.uniform(-20, 20, (count, 2))])
        self.R = Rotation.from_euler("ZYX", turns, degrees=True)
        ray = beacons - self.r[:, None]
        exact = (ray / np.linalg.norm(ray, axis=2)[..., None]) @ self.R.as_matrix()
        seen = exact + SIGMA * rng.normal(size=exact.shape)
        seen -= ((seen - exact) * exact).sum(axis=2)[..., None] * exact
        self.bearings = seen / np.linalg.norm(seen, axis=2)[..., None]

    def predictions(self) -> list[tuple[Array, Array]]:
        """Return predictions 5 cm and 3 deg off in any direction."""
        off, turn = self.rng.normal(size=(2, len(self.r), 3))
        off *= 0.05 / np.linalg.norm(off, axis=1)[:, None]
        turn *= math.radians(3.0) / np.linalg.norm(turn, axis=1)[:, None]
        q = np.roll((Rotation.from_rotvec(turn) * self.R).as_quat(), 1, axis=1)
        return list(zip(self.r + off, q, strict=True))


def solved(
    solver: PlanarPoseSolver, views: Views, predicted: bool
) -> tuple[list[int], list[PlanarPose]]:
    """Return those that were not refused."""
    predictions = views.predictions() if predicted else [None] * len(views.r)
    rows, poses = [], []
    for k, (seen, prediction) in enumerate(zip(views.bearings, predictions, strict=True)):
        try:
            poses.append(solver.solve(seen, SIGMA, prediction))
        except MeasurementError:
            continue
        rows.append(k)
    return rows, poses


@pytest.mark.parametrize(("low", "high"), [(0.09, 0.11), (0.12, 0.3)])
def test_low_over_a_beacon_a_pose_has_a_covariance_that_explains_its_error(
    rng: np.random.Generator, low: float, high: float
) -> None:
    """Before, 246 of 40,000 covariances were zero; mean normalised squares were 570 and 760."""
    views = Views(rng, SQUARE, 4000, low, high)
    rows, poses = solved(PlanarPoseSolver(SQUARE), views, predicted=True)
    assert len(poses) > 0.997 * len(views.r)
    squares = []
    for k, pose in zip(rows, poses, strict=True):
        assert np.linalg.eigvalsh(pose.covariance).min() > 0.0
        error = pose.position_w - views.r[k]
        squares.append(error @ np.linalg.solve(pose.covariance[:3, :3], error))
    print(f"mean normalised square {np.mean(squares):.2f}, largest {max(squares):.0f}")
    assert np.mean(squares) < 8.0
    assert np.median(squares) == pytest.approx(2.37, abs=0.25)


@pytest.mark.parametrize(
    ("beacons", "count"), [(SQUARE, 20_000), (ring(8), 3000), (ring(32), 2000)]
)
def test_good_bearings_are_never_refused(
    rng: np.random.Generator, beacons: Array, count: int
) -> None:
    views = Views(rng, beacons, count, 0.3, 2.0)
    rows, poses = solved(PlanarPoseSolver(beacons), views, predicted=True)
    assert len(rows) == count
    freedom = 2 * len(beacons) - 6
    costs = len(beacons) * np.array([pose.residual for pose in poses]) ** 2 / SIGMA**2
    assert costs.mean() == pytest.approx(freedom, rel=0.05)
    assert costs.max() < chi_square(freedom)


@pytest.mark.parametrize("beacons", [SQUARE, ring(8), ring(16)])
@pytest.mark.parametrize("excess", [1.15, 2.0])
def test_a_fit_that_noise_does_not_explain_is_refused(
    rng: np.random.Generator, beacons: Array, excess: float
) -> None:
    """Four beacons with 64 on 2 degrees of freedom passed, and with 111."""
    count = len(beacons)
    views = Views(rng, beacons, 20, 0.6, 1.5)
    solver, taken = PlanarPoseSolver(beacons), 0
    for seen in views.bearings:
        pose = solver.solve(seen, SIGMA)
        cost = count * pose.residual**2 / SIGMA**2
        # The same bearings, with a sigma that is too small.
        claimed = SIGMA * math.sqrt(cost / (excess * chi_square(2 * count - 6)))
        with pytest.raises(MeasurementError, match="no pose fits"):
            solver.solve(seen, claimed)
        solver.solve(seen, claimed * math.sqrt(1.3 * excess))
        taken += 1
    assert taken == 20


@pytest.mark.parametrize("freedom", range(2, 59, 2))
def test_the_bound_of_the_fit_is_that_of_its_probability(freedom: int) -> None:
    from scipy.stats import chi2

    missed = chi2.sf(chi_square(float(freedom)), freedom)
    assert 0.1 * FALSE_REFUSAL < missed < FALSE_REFUSAL
