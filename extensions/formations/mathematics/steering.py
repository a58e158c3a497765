"""Motions of a whole formation that people command, and what keeps them from breaking it up.

A null motion changes no bearing, so that the law of `law` does not oppose it. It slows down while
few edges hold the formation together, edges fade before they vanish, and neighbours do not come
too near to each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.rigidity import E_Z, yaw_rotation
from quadrotor.records import Array


@dataclass(frozen=True, slots=True)
class NullMotion:
    """A motion of the whole formation, which changes no bearing.

    Attributes:
        velocity_y: (3,) m/s of the centroid, in the yaw frame of the vehicle that commands.
        yaw_rate: rad/s, of all about the vertical through the centroid.
        scale_rate: 1/s, of all distances.
    """

    velocity_y: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rate: float = 0.0
    scale_rate: float = 0.0


def steering_velocity(
    command: NullMotion, place_y: npt.ArrayLike, yaw: float
) -> tuple[Array, float]:
    """Return a vehicle's part of a commanded motion: velocity (3,) m/s in its own yaw frame, and
    yaw rate, rad/s.

    It is added to `formation_velocity`. At the desired shape it changes no bearing.

    Args:
        place_y: (3,) m, of the vehicle from the centroid in its own yaw frame: that of the
            desired shape (`desired_places`) times the scale that one measured distance tells, or
            estimated (`NetworkFilter`).
        yaw: of the vehicle less that of the one that commands, rad.
    """
    place = np.asarray(place_y, dtype=float)
    velocity = yaw_rotation(-yaw) @ np.asarray(command.velocity_y, dtype=float)
    velocity = velocity + command.yaw_rate * np.cross(E_Z, place) + command.scale_rate * place
    return velocity, command.yaw_rate


def steering_pace(eigenvalue: float, bound: float) -> float:
    """Return the share of a command that is flown: 1 at a rigidity eigenvalue of twice the bound,
    falling smoothly to 0 at the bound.

    The law itself goes on, as by point 2 it does no harm while edges are missing; what is commanded
    would then move vehicles that nobody holds in place.
    """
    if bound <= 0.0:
        return 1.0
    x = min(1.0, max(0.0, eigenvalue / bound - 1.0))
    return x * x * (3.0 - 2.0 * x)


def separated_velocity(
    velocity_y: npt.ArrayLike,
    neighbours_y: npt.ArrayLike,
    least: float,
    rate: float = 1.0,
    drift: npt.ArrayLike = 0.0,
) -> Array:
    """Return the velocity nearest to `velocity_y` that approaches no neighbour too fast: toward
    one at distance d at most rate (d - least) / 2 in m/s, away from one that is nearer.

    Vehicles that all do so stay `least` apart, as each takes half of a pair's closing speed (a
    control barrier function, Ames et al. 2017, of the pairs' distances). Bearings do not tell
    distances: they are those of `NetworkFilter` or of a supervisor. The law above does without
    this and passes through any place, and with it two vehicles can come to rest against each
    other.

    Args:
        velocity_y: (3,) m/s. neighbours_y: (N, 3) m, from the vehicle, in the same axes.
        least: m. rate: 1/s.
        drift: (N,) m/s, mean velocity of both of a pair toward the neighbour, by which the pair
            moves together; the same at both of them.
    """
    x, y, z = np.asarray(velocity_y, dtype=float).tolist()
    others = np.asarray(neighbours_y, dtype=float).reshape(-1, 3)
    distance = np.linalg.norm(others, axis=1)
    toward = (others / np.maximum(distance, 1e-9)[:, None]).tolist()
    allowed = (0.5 * rate * (distance - least) + np.asarray(drift, dtype=float)).tolist()
    # Plain floats: for a few neighbours, numpy's calls cost more than the arithmetic.
    removed = [0.0] * len(toward)
    for _ in range(20):  # Dykstra's projection on the half spaces
        before = x, y, z
        for k, (u, v, w) in enumerate(toward):
            along = removed[k] + u * x + v * y + w * z
            share = max(0.0, along - allowed[k])
            change, removed[k] = removed[k] - share, share
            x, y, z = x + change * u, y + change * v, z + change * w
        if max(abs(x - before[0]), abs(y - before[1]), abs(z - before[2])) < 1e-6:
            break
    return np.array([x, y, z])


def edge_weight(
    bearing_y: npt.ArrayLike, axis_y: npt.ArrayLike, half_angle: float, margin: float
) -> float:
    """Return the weight of an edge: 1 well within the observer's field of view, falling smoothly to
    0 at its border, so that no velocity jumps when the edge vanishes.

    It depends on the bearing that the observer broadcasts, so that both ends know it.

    Args:
        axis_y: (3,) unit vector, axis of the sensor in the observer's yaw frame. half_angle: rad
            about it. margin: rad inside the border in which the weight falls.
    """
    cosine = float(np.dot(np.asarray(bearing_y, dtype=float), np.asarray(axis_y, dtype=float)))
    x = (half_angle - math.acos(max(-1.0, min(1.0, cosine)))) / margin
    x = min(1.0, max(0.0, x))
    return x * x * (3.0 - 2.0 * x)
