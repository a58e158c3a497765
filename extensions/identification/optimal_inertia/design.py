"""The choice of doublets for the inertia: optimal input design over a grid of candidates.

About each axis J_i alpha_i = tau_i. With the torque known and the noise of the acceleration white
behind the estimator's filters, the standard error of the estimate, as a share of J_i, is

    sigma_i / J_i = sigma_alpha / sqrt(integral of alpha_i^2 dt),

alpha_i being the angular acceleration behind the same filters, so that integral is the information
that an excitation gives (Mehra 1974; for flying vehicles Morelli and Klein 2016, chapter 9). A
candidate's information follows from a model of the closed loop: the vehicle's own gains and limits,
the lag of its motors, the yaw torque at its bound. The axes share nothing, so the information
matrix is diagonal: the E-optimal design makes the smallest entry as large as possible, the
D-optimal design the product.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from console.experiments.inertia import REST
from control.trajectories.multistep import LEAD, LEVELS
from quadrotor.errors import UsageError
from quadrotor.records import Array

STEP = 0.005
"""s, of the model."""
SETTLING = REST
"""s after the last level, until the next excitation begins."""
DURATIONS = tuple(round(0.1 * k, 1) for k in range(2, 16))
"""s of a level."""
SHARES = (0.25, 0.4, 0.55, 0.7, 0.85, 1.0)
"""Amplitudes as shares of the largest that the vehicle accepts."""
REPEATS = 5
"""Most doublets of one excitation."""
ROOM = 0.8
"""Share of the limits of the flight that a candidate may use in the model."""
DOUBLET = LEVELS["doublet"]
FILTER_POLE, WASHOUT_POLE = 2.0 * math.pi, 0.5
"""rad/s, of the estimator of the inertia (`InertiaParameters`), whose module is compiled: this one
runs in the station, which has no compiler."""
CRITERIA: dict[str, Callable[[list[float]], float]] = {"worst_axis": min, "all_axes": math.prod}
"""The value of a design for its information about the axes, by criterion: E- and D-optimal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """The closed loop about one axis, per unit of inertia.

    Attributes:
        kp, kv, ki: gains of position; zero for the yaw, which has no position above it.
        kr, kw, kf: gains of attitude.
        gravity: m/s², from tilt to acceleration; 0 for the yaw.
        tilt_max: tangent of the largest tilt of the desired force.
        torque_max: rad/s², bound of the torque.
        lag: s, of the motors.
    """

    kp: float = 0.0
    kv: float = 0.0
    ki: float = 0.0
    kr: float
    kw: float
    kf: float
    gravity: float = 0.0
    tilt_max: float = math.inf
    torque_max: float = math.inf
    lag: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """The limits that a candidate has to keep, in the model.

    Attributes:
        amplitude: m or rad, the largest that the vehicle accepts.
        offset: m or rad, from the middle.
        angle: rad, of the tilt; infinite for the yaw.
        rate: rad/s.
    """

    amplitude: float
    offset: float
    angle: float
    rate: float


@dataclass(frozen=True, slots=True)
class Candidate:
    """Doublets about one axis, with the figures that the model predicts.

    Attributes:
        amplitude: m or rad. duration: s of a level. information: rad²/s³.
    """

    axis: str
    amplitude: float
    duration: float
    repeats: int
    information: float

    @property
    def seconds(self) -> float:
        """Return the time from the start until the vehicle is at rest again, s."""
        return LEAD + len(DOUBLET) * self.duration * self.repeats + SETTLING


@dataclass(frozen=True, slots=True)
class Response:
    """The behavior of the model in N excitations.

    Attributes:
        information: (REPEATS, N) rad²/s³, after each of the doublets.
        offset: (N,) m or rad, the largest. angle: (N,) rad. rate: (N,) rad/s.
    """

    information: Array
    offset: Array
    angle: Array
    rate: Array

    def keeps(self, bounds: Bounds) -> npt.NDArray[np.bool_]:
        """Return which of the excitations (N,) keep the bounds."""
        return (
            (self.offset <= bounds.offset)
            & (self.angle <= bounds.angle)
            & (self.rate <= bounds.rate)
        )


def respond(loop: Loop, amplitude: Array, duration: Array) -> Response:
    """Simulate N excitations of REPEATS doublets from rest.

    Args:
        amplitude: (N,) m or rad. duration: (N,) s of a level.
    """
    levels = np.array(DOUBLET * REPEATS + (0.0,))
    ends = LEAD + len(DOUBLET) * np.outer(np.arange(1, REPEATS + 1), duration)
    position, speed, integral, angle, rate, turned, torque = np.zeros((7, len(amplitude)))
    fast, slow, gained = np.zeros((3, len(amplitude)))
    information, most = np.zeros(ends.shape), np.zeros((3, len(amplitude)))
    follow = -math.expm1(-STEP / loop.lag)
    share, drift = -math.expm1(-FILTER_POLE * STEP), -math.expm1(-WASHOUT_POLE * STEP)
    for k in range(round((ends.max() + SETTLING) / STEP)):
        level = np.floor((k * STEP - LEAD) / duration).astype(int)
        wanted = amplitude * levels[np.where(level < 0, -1, np.minimum(level, len(levels) - 1))]
        if loop.gravity:
            error = wanted - position
            pull = loop.kp * error - loop.kv * speed + loop.ki * integral
            wanted = np.arctan(np.clip(pull / loop.gravity, -loop.tilt_max, loop.tilt_max))
            integral += STEP * error
            speed += STEP * loop.gravity * np.tan(angle)
            position += STEP * speed
        twist = np.sin(wanted - angle)
        command = loop.kr * twist - loop.kw * rate + loop.kf * turned
        turned += STEP * twist
        torque += follow * (np.clip(command, -loop.torque_max, loop.torque_max) - torque)
        rate += STEP * torque
        angle += STEP * rate
        fast += share * (torque - fast)
        slow += drift * (fast - slow)
        gained += STEP * np.square(fast - slow)
        information = np.where(k * STEP < ends, gained, information)
        most = np.maximum(most, np.abs((position if loop.gravity else angle, angle, rate)))
    return Response(information, *most)


def candidates(axis: str, loop: Loop, bounds: Bounds) -> list[Candidate]:
    """Return the candidates that keep the bounds, each the best one of its time or a shorter one,
    the shortest first.
    """
    sizes = np.floor(1e3 * bounds.amplitude * np.array(SHARES)) * 1e-3
    size, duration = (one.ravel() for one in np.meshgrid(sizes, DURATIONS, indexing="ij"))
    seen = respond(loop, size, duration)
    found = [
        Candidate(axis, round(float(size[k]), 3), float(duration[k]), repeats + 1, float(gained[k]))
        for k in np.flatnonzero(seen.keeps(bounds))
        for repeats, gained in enumerate(seen.information)
    ]
    found.sort(key=lambda one: (one.seconds, -one.information))
    front: list[Candidate] = []
    for one in found:
        if not front or one.information > front[-1].information:
            front.append(one)
    return front


def choose(
    offered: dict[str, list[Candidate]], seconds: float, criterion: str = "worst_axis"
) -> tuple[Candidate, ...]:
    """Return one candidate for each axis, together within `seconds`, that are best by a criterion
    of `CRITERIA`. Raises UsageError when an axis has none, or even the shortest take longer.
    """
    for axis, front in offered.items():
        if not front:
            raise UsageError(
                f"no doublet about {axis} stays within the limits of this vehicle; raise "
                "behavior.trajectory_tilt_max or trajectory_body_rate_max, or fly `inertia`"
            )
    value = CRITERIA[criterion]
    best: tuple[Candidate, ...] = ()
    reached = -math.inf
    for picked in itertools.product(*offered.values()):
        if sum(one.seconds for one in picked) <= seconds + 1e-9:
            worth = value([one.information for one in picked])
            if worth > reached:
                best, reached = picked, worth
    if not best:
        least = sum(front[0].seconds for front in offered.values())
        raise UsageError(
            f"an excitation of all axes takes {least:.1f} s at least, and {seconds:g} s were "
            "given; give more"
        )
    return best
