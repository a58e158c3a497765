"""Pose from one frame of bearings: error over the Cramer-Rao bound, and time, ours and peers'.

The ratio of a row is rms(error) / rms(bound): the root of the mean over poses of |error|^2, over
the root of the mean over the same poses of the trace of their Cramer-Rao bound; in position (m,
world axes) and in attitude (rotation vector, rad). For a method that refuses poses, both are over
the accepted ones; refused ones are most often the hardest, which flatters the method.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.estimation.literal_pose import literal_pose
from benchmarks.estimation.opencv_pose import OpenCVPose
from benchmarks.harness import Report, Row, Size, Target, time_in_turns
from estimation.poses.planar_pose import PlanarPoseSolver
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

Method = Callable[[Array], tuple[Array, Array]]
"""Function from bearings (N, 3) to position_w (3,) and R_wb (3, 3); raises MeasurementError."""

SIGMA = math.radians(1.5)
SQUARE = np.array([[1.0, 1.0, 0.1], [1.0, -1.0, 0.1], [-1.0, -1.0, 0.1], [-1.0, 1.0, 0.1]])
SEEDS = (1, 2)
FAR = 0.5
"""Error, in m, beyond which a pose is an outlier."""


@dataclass(frozen=True)
class Frames:
    """Poses (n, 3), n attitudes, bearings without and with noise (n, N, 3), to beacons (N, 3)."""

    beacons: Array
    r: Array
    R: Array
    exact: Array
    bearings: Array

    @property
    def bounds(self) -> Array:
        """Return (n, 6, 6) Cramer-Rao bound: position, then rotation vector, world axes.

        A tangent component of the bearing d changes by -(I - d d^T) / rho with position and by
        d cross phi with rotation; those of N bearings are independent.
        """
        ray = self.beacons - self.r[:, None]
        rho = np.linalg.norm(ray, axis=2)[..., None, None]
        d = ray / rho[..., 0]
        P = np.eye(3) - d[..., :, None] * d[..., None, :]
        J = np.concatenate([-P / rho, -np.cross(np.eye(3), d[..., None, :])], axis=3)
        information = np.einsum("nkia,nkib->nab", J, J)
        bounds: Array = SIGMA**2 * np.linalg.inv(information)
        return bounds


FARTHEST_DRAWN = 10.0
"""Ratio to the bound beyond which methods are in the table but not in the plot."""


def frames(beacons: Array, count: int, seed: int, low: float = 0.3, high: float = 2.0) -> Frames:
    """Return poses of the envelope, with noisy bearings.

    x, y in +-1.2 m, roll, pitch +-20 deg, any yaw.
    """
    rng = np.random.default_rng([seed, len(beacons)])
    r = np.column_stack([rng.uniform(-1.2, 1.2, (count, 2)), rng.uniform(low, high, count)])
    angles = np.column_stack([rng.uniform(-180, 180, count), rng.uniform(-20, 20, (count, 2))])
    R: Array = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    ray = beacons - r[:, None]
    exact = (ray / np.linalg.norm(ray, axis=2)[..., None]) @ R
    noisy = exact + SIGMA * rng.normal(size=exact.shape)
    noisy -= ((noisy - exact) * exact).sum(axis=2)[..., None] * exact
    noisy /= np.linalg.norm(noisy, axis=2)[..., None]
    return Frames(beacons, r, R, exact, noisy)


def accuracy(method: Method, seen: Frames) -> dict[str, float]:
    """Return ratios to the bound, the share refused and the share beyond FAR (of all)."""
    taken, positions, attitudes = [], [], []
    for k, bearings in enumerate(seen.bearings):
        try:
            position, R_wb = method(bearings)
        except MeasurementError:
            continue
        taken.append(k)
        positions.append(position.copy())
        attitudes.append(R_wb)
    error = np.linalg.norm(np.array(positions) - seen.r[taken], axis=1)
    between = Rotation.from_matrix(np.array(attitudes)) * Rotation.from_matrix(seen.R[taken]).inv()
    variance = np.diagonal(seen.bounds[taken], axis1=1, axis2=2)
    turned = between.magnitude()
    count = len(seen.r)
    return {
        "position / bound": math.sqrt((error**2).mean() / variance[:, :3].sum(axis=1).mean()),
        "attitude / bound": math.sqrt((turned**2).mean() / variance[:, 3:].sum(axis=1).mean()),
        "beyond 0.5 m %": 100.0 * float((error > FAR).sum()) / count,
        "refused %": 100.0 * (1.0 - len(taken) / count),
    }


def ours(beacons: Array, steps: int = 12) -> Method:
    solver = PlanarPoseSolver(beacons, steps=steps)

    def method(bearings: Array) -> tuple[Array, Array]:
        pose = solver.solve(bearings, SIGMA)
        w, x, y, z = pose.quaternion_wb
        return pose.position_w, Rotation.from_quat([x, y, z, w]).as_matrix()

    return method


def as_printed(beacons: Array) -> Method:
    normal, d = np.array([0.0, 0.0, 1.0]), float(beacons[0, 2])
    return lambda bearings: literal_pose(beacons, bearings, normal, d)


def poselib_pose(beacons: Array, polish: bool) -> Method:
    """Return v. Larsson and contributors' PoseLib: p3p on bearings, with the fourth to choose.

    Args:
        polish: refine it on image points of a camera aimed along the bearings.
    """
    import poselib

    camera = {"model": "PINHOLE", "width": 1, "height": 1, "params": [1.0, 1.0, 0.0, 0.0]}

    def method(bearings: Array) -> tuple[Array, Array]:
        best: Any = None
        least = math.inf
        for pose in poselib.p3p(bearings[:3], beacons[:3]):
            ray = beacons @ pose.R.T + pose.t
            ray /= np.sqrt((ray**2).sum(axis=1))[:, None]
            cost = ((ray - bearings) ** 2).sum()
            if cost < least:
                best, least = pose, cost
        if best is None:
            raise MeasurementError("p3p found no pose")
        if polish:
            z = bearings.sum(axis=0)
            z /= math.sqrt(z @ z)
            x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
            x /= math.sqrt(x @ x)
            R_cb = np.stack([x, np.cross(z, x), z])
            seen = bearings @ R_cb.T
            if seen[:, 2].min() < 0.01:
                raise MeasurementError("a bearing is behind the camera")
            start = poselib.CameraPose()
            start.R, start.t = R_cb @ best.R, R_cb @ best.t
            found, _ = poselib.refine_absolute_pose(
                seen[:, :2] / seen[:, 2:], beacons, start, camera, {}
            )
            return -found.R.T @ found.t, found.R.T @ R_cb
        return -best.R.T @ best.t, best.R.T

    return method


def cycled(function: Callable[[Array], object], bearings: Array) -> Callable[[], None]:
    """Return a call over all frames; a refused frame counts with the time of its refusal."""
    one_by_one = list(bearings)

    def call() -> None:
        for one in one_by_one:
            try:  # noqa: SIM105, suppress() would cost half of what is measured
                function(one)
            except MeasurementError:
                pass

    return call


def run(size: Size = Size.FULL) -> Report:
    count = size.of(20000, 2000, 200)
    report = Report(
        "pose",
        "Pose from one frame of bearings",
        [
            "4 beacons (±1, ±1, 0.1) m; x, y ∈ ±1.2 m, z ∈ 0.3…2 m, roll, pitch ±20°, any yaw",
            f"noise 1.5° on each of two tangent axes, one frame; {count} poses a seed, seeds 1, 2",
            "ratio = rms error over rms Cramér–Rao bound of the poses the method took",
            "µs a Python call, median of rounds in turns; refused frames count",
        ],
    )
    samples = [frames(SQUARE, count, seed) for seed in SEEDS]
    rms = [np.diagonal(one.bounds, axis1=1, axis2=2).mean(axis=0) for one in samples]
    position = math.sqrt(np.mean([one[:3].sum() for one in rms]))
    attitude = math.degrees(math.sqrt(np.mean([one[3:].sum() for one in rms])))
    report.notes.append(f"bound: {position:.4f} m, {attitude:.3f}° rms")
    solver = PlanarPoseSolver(SQUARE)
    methods: dict[str, tuple[Method, Callable[[Array], object]]] = {}

    def add(name: str, method: Method, timed: Callable[[Array], object] | None = None) -> None:
        methods[name] = (method, timed or method)

    add("quadlab", ours(SQUARE), lambda x: solver.solve(x, SIGMA))
    for steps, name in ((0, "homography alone"), (2, "homography + at most 2 Gauss–Newton steps")):
        fewer = PlanarPoseSolver(SQUARE, steps=steps)
        add(name, ours(SQUARE, steps), partial(fewer.solve, sigma=SIGMA))
    add("print as it stands", as_printed(SQUARE))
    for kind in ("SQPNP", "IPPE"):
        for polish in ("", "LM", "VVS"):
            for aimed in (False, True):
                title = f"cv2 {kind}{' + ' + polish if polish else ''}, camera "
                title += "along the bearings' mean" if aimed else "downward"
                add(title, OpenCVPose(SQUARE, kind, polish, aimed).solve)
    try:
        add("PoseLib p3p, the fourth chooses", poselib_pose(SQUARE, False))
        add("PoseLib p3p + refine, camera along the bearings' mean", poselib_pose(SQUARE, True))
    except ImportError:
        report.notes.append("PoseLib is not installed: left out (pip install --no-deps poselib)")
    some = size.of(400, 100, 20)
    timings = time_in_turns(
        {
            name: (cycled(timed, samples[0].bearings[:some]), 1)
            for name, (_, timed) in methods.items()
        }
    )
    for name, (method, _) in methods.items():
        found = [accuracy(method, one) for one in samples]
        row: dict[str, float | str] = {"µs": timings[name].median / some * 1e6}
        row["times quadlab's"] = timings[name].over(timings["quadlab"])
        row.update({key: max(one[key] for one in found) for key in found[0]})
        report.rows.append(Row(name, row))
    figures = {row.method: row.figures for row in report.rows}
    best = figures["quadlab"]
    sqpnp, ippe = figures["cv2 SQPNP, camera downward"], figures["cv2 IPPE, camera downward"]
    report.targets += [
        Target("position over bound, worse seed", float(best["position / bound"]), 1.03),
        Target("attitude over bound, worse seed", float(best["attitude / bound"]), 1.03),
        Target("refused, %", float(best["refused %"]), 0.0),
        Target("beyond 0.5 m, %", float(best["beyond 0.5 m %"]), 0.5),
        Target("µs a Python call", float(best["µs"]), 2.0),
        Target("times as fast as cv2 SQPNP", float(sqpnp["times quadlab's"]), 25.0, False),
        Target("times as fast as cv2 IPPE", float(ippe["times quadlab's"]), 10.0, False),
    ]
    drawn = [
        row
        for row in report.rows
        if float(row.figures["position / bound"]) < FARTHEST_DRAWN and "+" not in row.method
    ]
    report.plot = {
        "kind": "scatter",
        "x": [row.figures["µs"] for row in drawn],
        "y": [row.figures["position / bound"] for row in drawn],
        "labels": [row.method for row in drawn],
        "x_label": "µs a Python call",
        "y_label": "position error / Cramér–Rao bound",
        "limit": 1.0,
        "limit_label": "Cramér–Rao bound",
    }
    _origins(report, samples[0])
    _more_beacons(report, count)
    _near_the_plane(report, count)
    report.notes.append("where two seeds differ the worse figure is shown")
    return report


def _origins(report: Report, seen: Frames) -> None:
    """Compare origins of the world at several distances from the beacons' plane."""
    solved = []
    for distance in (0.0, 0.1, 1.0, 5.0):
        shift = np.array([0.0, 0.0, distance - 0.1])
        solver = PlanarPoseSolver(SQUARE + shift)
        poses = [solver.solve(x, SIGMA) for x in seen.bearings]
        solved.append([np.r_[one.position_w - shift, one.quaternion_wb] for one in poses])
    spread = float(np.abs(np.array(solved) - solved[0]).max())
    what = "pose with the world's origin 0, 0.1, 1, 5 m off the plane: difference, m or 1"
    report.targets.append(Target(what, spread, 1e-9))


def _more_beacons(report: Report, count: int) -> None:
    """Compare 8, 16 and 32 beacons: on a circle, and at random but apart in the plane."""
    for size in (8, 16, 32):
        angle = 2.0 * np.pi * np.arange(size) / size
        circle = np.column_stack([np.cos(angle), np.sin(angle), np.full(size, 0.1)])
        rng = np.random.default_rng(size)
        apart = 1.2 / math.sqrt(size)
        random = np.column_stack([_apart(rng, size, apart), np.full(size, 0.1)])
        for name, beacons in (
            ("on a circle of 1 m", circle),
            (f"at random in 2 m x 2 m, {apart:.2f} m apart or more", random),
        ):
            samples = [frames(beacons, count, seed) for seed in SEEDS]
            found = [accuracy(ours(beacons), one) for one in samples]
            solver, some = PlanarPoseSolver(beacons), samples[0].bearings[:400]
            call = cycled(partial(solver.solve, sigma=SIGMA), some)
            time = time_in_turns({"quadlab": (call, 1)})["quadlab"].median / len(some)
            row: dict[str, float | str] = {"µs": time * 1e6}
            row.update({key: max(one[key] for one in found) for key in found[0]})
            report.rows.append(Row(f"quadlab, {size} beacons {name}", row))
            reached = row
            found = [_from_the_truth(solver, one) for one in samples]
            row = {key: max(one[key] for one in found) for key in found[0]}
            report.rows.append(Row("the same, searched from the true pose", row))
            for part in ("position", "attitude"):
                what = f"{part} over bound, {size} beacons {name}"
                report.targets.append(Target(what, float(reached[f"{part} / bound"]), 1.02))


def _from_the_truth(solver: PlanarPoseSolver, seen: Frames) -> dict[str, float]:
    """Return the errors of the least-squares estimate: its search starts at the true pose."""
    q = np.roll(Rotation.from_matrix(seen.R).as_quat(), 1, axis=1)
    truths = iter(zip(seen.r, q, strict=True))

    def method(bearings: Array) -> tuple[Array, Array]:
        pose = solver.solve(bearings, SIGMA, next(truths))
        w, x, y, z = pose.quaternion_wb
        return pose.position_w, Rotation.from_quat([x, y, z, w]).as_matrix()

    return accuracy(method, seen)


def _apart(rng: np.random.Generator, count: int, least: float) -> Array:
    """Return (count, 2) points of the square +-1 m, each at least `least` (m) from the others."""
    points: list[Array] = []
    while len(points) < count:
        one = rng.uniform(-1.0, 1.0, 2)
        if all(np.hypot(*(one - other)) >= least for other in points):
            points.append(one)
    return np.array(points)


def _near_the_plane(report: Report, count: int) -> None:
    """Solve at z 0.09 to 0.11 m, from a prediction 5 cm and 3 deg off in any direction."""
    far, refused, largest = 0, 0, 0.0
    solver = PlanarPoseSolver(SQUARE)
    for seed in SEEDS:
        seen = frames(SQUARE, count, seed, 0.09, 0.11)
        rng = np.random.default_rng(seed)
        off, turn = rng.normal(size=(2, count, 3))
        off *= 0.05 / np.linalg.norm(off, axis=1)[:, None]
        turn *= math.radians(3.0) / np.linalg.norm(turn, axis=1)[:, None]
        q = (Rotation.from_rotvec(turn) * Rotation.from_matrix(seen.R)).as_quat()
        for k in range(count):
            prediction = seen.r[k] + off[k], np.roll(q[k], 1)
            try:
                pose = solver.solve(seen.bearings[k], SIGMA, prediction)
            except MeasurementError:
                refused += 1
                continue
            error = float(np.linalg.norm(pose.position_w - seen.r[k]))
            far += error > FAR
            largest = max(largest, error)
    share = 100.0 / (len(SEEDS) * count)
    report.rows.append(
        Row(
            "quadlab, z 0.09…0.11 m from a prediction 5 cm, 3° off",
            {"beyond 0.5 m %": far * share, "refused %": refused * share},
        )
    )
    what = "near the plane, from a prediction: beyond 0.5 m or refused, %"
    report.targets.append(Target(what, (far + refused) * share, 0.8))
    report.notes.append(f"near the plane the largest position error is {largest:.2f} m")
