"""The one place where our frames become MAVLink's and back.

World: x is east, y north, z up (ENU, as ROS REP 103 has it); MAVLink's local frame is north, east,
down (NED). Body: x forward, y left, z up (FLU) becomes forward, right, down (FRD). With the
permutation P: (x, y, z) → (y, x, −z) of the world and D = diag(1, −1, −1) of the body, both their
own inverses, R_ned_frd = P R_wb D. Latitude and longitude are of a plane that touches the sphere at
the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from quadrotor.errors import UsageError

EARTH = 6_371_000.0
"""Radius of the sphere, in m, as MAVSDK has it."""
HALF = math.sqrt(0.5)

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def swap_world(v_w: Vector) -> Vector:
    """Return a world vector in NED, or one in NED in the world: the map is its own inverse."""
    return v_w[1], v_w[0], -v_w[2]


def swap_body(v_b: Vector) -> Vector:
    """Return a body vector in FRD, or one in FRD in our axes: the map is its own inverse."""
    return v_b[0], -v_b[1], -v_b[2]


def swap_yaw(yaw: float) -> float:
    """Return a yaw (rad) from north to the east, or one from x to y: its own inverse."""
    return math.remainder(math.pi / 2.0 - yaw, 2.0 * math.pi) if math.isfinite(yaw) else math.nan


def swap_attitude(q_wb: Quaternion) -> Quaternion:
    """Return the attitude (w, x, y, z) of FRD in NED, or back: q_P q_wb q_D, with q_P half a turn
    about (1, 1, 0)/√2 and q_D half a turn about x.
    """
    w, x, y, z = q_wb
    # q_wb q_D with q_D = (0, 1, 0, 0), then q_P in front with q_P = (0, √½, √½, 0).
    w, x, y, z = -x, w, z, -y
    out = (-HALF * (x + y), HALF * (w + z), HALF * (w - z), HALF * (y - x))
    return out if out[0] >= 0.0 else (-out[0], -out[1], -out[2], -out[3])


class Place(NamedTuple):
    """Latitude and longitude in degrees, altitude in m above the sea."""

    latitude: float
    longitude: float
    altitude: float


@dataclass(frozen=True, slots=True)
class Origin:
    """The place on Earth of the world's origin is."""

    place: Place

    def global_of(self, position_w: Vector) -> Place:
        """Return the place of a point of the world (m)."""
        x, y, z = position_w
        at = self.place
        east = EARTH * math.cos(math.radians(at.latitude))
        return Place(
            at.latitude + math.degrees(y / EARTH),
            at.longitude + math.degrees(x / east),
            at.altitude + z,
        )

    def world_of(self, place: Place) -> Vector:
        """Return the point of the world (m) at a place."""
        at = self.place
        east = EARTH * math.cos(math.radians(at.latitude))
        return (
            east * math.radians(place.longitude - at.longitude),
            EARTH * math.radians(place.latitude - at.latitude),
            place.altitude - at.altitude,
        )


def parse_origin(words: str) -> Origin:
    """Return the origin of 'LATITUDE,LONGITUDE[,ALTITUDE]'. Raises UsageError."""
    try:
        latitude, longitude, altitude = ([float(one) for one in words.split(",")] + [0.0])[:3]
        if not (abs(latitude) <= 85.0 and abs(longitude) <= 180.0 and abs(altitude) <= 9000.0):
            raise ValueError
    except ValueError:
        raise UsageError(
            f"--origin {words} is not a place; give LATITUDE,LONGITUDE,ALTITUDE in degrees (up "
            "to ±85 and ±180) and m, like --origin 47.397742,8.545594,0"
        ) from None
    return Origin(Place(latitude, longitude, altitude))
