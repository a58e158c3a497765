"""A vehicle that flies the paper's figure 8 exactly, and sensors with the lab's noise.

They are independent of the package: the truth is differentiated numerically and rotated by scipy.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from estimation.complementary import ComplementaryEstimator
from estimation.parameters import EstimationParameters
from quadrotor.records import ESTIMATE, IMU_SAMPLE, POSE_SAMPLE, Array, Record, new_state

G = 9.81
UP = np.array([0.0, 0.0, G])


def quaternion(rotation: Rotation) -> Array:
    """Return (w, x, y, z)."""
    return np.roll(rotation.as_quat(), 1, axis=-1)


@dataclass
class Truth:
    """Samples of an exact flight: times (n,), vectors (n, 3), attitudes."""

    t: Array
    position_w: Array
    velocity_w: Array
    attitude: Rotation
    angular_velocity_b: Array
    specific_force_b: Array


def figure_eight(
    duration: float, rate: float, scale: float = 1.0, turned: float = 0.0, period: float = 8.0
) -> Truth:
    """Return a figure 8 of 1 m x 1 m, z +-0.2 m, yaw +-1 rad, times `scale`.

    The world is turned by `turned` rad.
    """
    t = np.arange(round(duration * rate) + 1) / rate
    w = 2.0 * np.pi / period
    size = scale * np.array([0.5, 0.5, 0.2])
    n = np.array([1.0, 2.0, 1.0]) * w
    world = Rotation.from_euler("z", turned)

    def attitude(at: Array) -> Rotation:
        a = -size * n**2 * np.sin(np.outer(at, n))
        z = a + UP
        z /= np.linalg.norm(z, axis=1)[:, None]
        yaw = scale * np.sin(w * at)
        x = np.cross(np.stack([-np.sin(yaw), np.cos(yaw), 0.0 * yaw], 1), z)
        x /= np.linalg.norm(x, axis=1)[:, None]
        return world * Rotation.from_matrix(np.stack([x, np.cross(z, x), z], 2))

    R = attitude(t)
    h = 1e-4
    phase = np.outer(t, n)
    position = size * np.sin(phase) + [0.0, 0.0, 1.0]
    acceleration = -size * n**2 * np.sin(phase)
    return Truth(
        t,
        world.apply(position),
        world.apply(size * n * np.cos(phase)),
        R,
        (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2.0 * h),
        R.inv().apply(world.apply(acceleration) + UP),
    )


Spoil = Callable[[Array, Array, Array, Array], None]
"""Function that changes the measurements of a flight in place.

Its arguments are times (n,), measured positions (n, 3), quaternions (n, 4) and forces (n, 3). A
position that is not finite is a missing pose.
"""


@dataclass(frozen=True)
class Sensors:
    """Sensors of the estimator; the defaults are exact."""

    pose_every: int = 5  # ticks
    delay: int = 0  # ticks between the instant of a pose and its arrival
    pose_until: float = np.inf  # s
    position_noise: float = 0.0  # m
    attitude_noise: float = 0.0  # rad
    force_noise: float = 0.0  # m/s^2
    rate_noise: float = 0.0  # rad/s
    force_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rate_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quantised: bool = False
    sign: float = 1.0  # of the measured quaternion


LAB = Sensors(
    position_noise=1e-3,
    attitude_noise=np.radians(0.2),
    force_noise=0.05,
    rate_noise=np.radians(0.5),
    force_bias=(0.05, -0.05, 0.05),
    rate_bias=tuple(np.radians([0.1, -0.1, 0.1])),
    quantised=True,
)


@dataclass
class Flown:
    """Errors estimate - truth at each tick, and the estimator at the end."""

    t: Array
    position: Array
    velocity: Array
    attitude: Array  # rotation vectors, rad
    rate: Array
    states: Record
    force_bias: Array  # estimates
    rate_bias: Array
    estimator: ComplementaryEstimator
    estimate: Record = field(repr=False)
    estimates: Record = field(repr=False)  # ESTIMATE at each tick
    converged: npt.NDArray[np.bool_] = field(repr=False)

    def rms(self, name: str, after: float) -> float:
        error: Array = getattr(self, name)[self.t >= after]
        return float(np.sqrt((error**2).sum(axis=1).mean()))


def fly(
    truth: Truth,
    sensors: Sensors,
    parameters: EstimationParameters | None = None,
    seed: int = 0,
    spoil: Spoil | None = None,
) -> Flown:
    """Run the estimator along a flight; `spoil` may change the measurements."""
    rng = np.random.default_rng(seed)
    count, s = len(truth.t), sensors
    force = truth.specific_force_b + s.force_bias + rng.normal(0, 1, (count, 3)) * s.force_noise
    rate = truth.angular_velocity_b + s.rate_bias + rng.normal(0, 1, (count, 3)) * s.rate_noise
    if s.quantised:
        force = np.round(force / (0.0039 * G)) * 0.0039 * G
        rate = np.round(rate / np.radians(0.586)) * np.radians(0.586)
    position = truth.position_w + rng.normal(0, 1, (count, 3)) * s.position_noise
    wobble = Rotation.from_rotvec(rng.normal(0, 1, (count, 3)) * s.attitude_noise)
    attitude = s.sign * quaternion(truth.attitude * wobble)
    if spoil is not None:
        spoil(truth.t, position, attitude, force)
    stamps = np.round(truth.t * 1e9).astype(np.int64) + 1_000_000_000
    dt = float(truth.t[1] - truth.t[0])

    estimator = ComplementaryEstimator(parameters)
    imu, pose, state = np.zeros(1, IMU_SAMPLE), np.zeros(1, POSE_SAMPLE), new_state()
    estimate = np.zeros(1, ESTIMATE)
    states, estimates = np.zeros(count, state.dtype), np.zeros(count, ESTIMATE)
    converged = np.zeros(count, bool)
    biases = np.zeros((2, count, 3))
    for i in range(count):
        imu["stamp_ns"] = stamps[i]
        imu["specific_force_b"], imu["angular_velocity_b"] = force[i], rate[i]
        estimator.predict(imu, dt, state)
        states[i] = state[0]
        j = i - s.delay
        due = j >= 0 and j % s.pose_every == 0 and truth.t[j] <= s.pose_until
        if due and math.isfinite(position[j, 0]):
            pose["stamp_ns"] = stamps[j]
            pose["position_w"], pose["quaternion_wb"] = position[j], attitude[j]
            estimator.correct(pose, estimate)
        estimator.report(estimate)
        estimates[i], converged[i] = estimate[0], estimator.converged
        biases[0, i] = estimate["accelerometer_bias_b"][0]
        biases[1, i] = estimate["gyroscope_bias_b"][0]
    q = np.roll(states["quaternion_wb"], -1, axis=1)
    return Flown(
        truth.t,
        states["position_w"] - truth.position_w,
        states["velocity_w"] - truth.velocity_w,
        (truth.attitude.inv() * Rotation.from_quat(q)).as_rotvec(),
        states["angular_velocity_b"] - truth.angular_velocity_b,
        states,
        biases[0],
        biases[1],
        estimator,
        estimate,
        estimates,
        converged,
    )


AnySensors = Sensors


@dataclass(frozen=True)
class Laboratory:
    """All helpers of this file, which tests use through one fixture."""

    figure_eight: Callable[..., Truth] = figure_eight
    fly: Callable[..., Flown] = fly
    Sensors: type[Sensors] = Sensors
    full: AnySensors = LAB


@pytest.fixture(scope="session")
def laboratory() -> Laboratory:
    return Laboratory()


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Return a generator seeded from the test's name."""
    seed = zlib.crc32(request.node.name.encode())
    print(f"seed {seed} from {request.node.name}")
    return np.random.default_rng(seed)
