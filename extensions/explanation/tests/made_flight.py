"""A flight along a smooth curve whose sensors agree, made without a simulator, to be falsified."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bearing_sim.beacons import parse_layout
from flight_log.fields import ATTITUDE, FORCE, POSITION, RATE, TRACKED, TRACKED_ATTITUDE
from flight_log.run import Series
from quadrotor.constants import GRAVITY
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array

END = 40.0
MASS = 1.3
PARAMETERS: dict[str, ParameterValue] = {
    "model.mass": MASS,
    "model.drag": 0.0,
    "beacons.layout": "paper",
}
SIGMA = np.radians(1.5)


class Columns(Series):
    """Topic with given times and columns."""

    def __init__(self, time: Array, columns: Mapping[str, Any], flags: Any = ()) -> None:
        self.time, self._flags = time, list(flags)
        self._values = {
            name: np.broadcast_to(np.asarray(values, np.float32), time.shape)
            for name, values in columns.items()
        }

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def values(self, name: str, first: int = 0, last: int | None = None) -> Any:
        return self._values[name][first:last]

    def changes(self, path: str) -> list[tuple[float, str]]:
        return self._flags


def named(names: tuple[str, ...], rows: Array) -> dict[str, Array]:
    return dict(zip(names, rows.T, strict=True))


class Flight:
    """True motion of a flight in still air, and what its sensors read.

    Attributes:
        time: of 500 samples a second; `poses` those of the tracker, `frames` those of bearings.
        place, velocity, push: in m, m/s, and m/s² (thrust over mass), (N, 3), world axes.
        felt, rates: of the IMU, body axes; thrust in N; tracked in m.
    """

    def __init__(self, seed: int = 1) -> None:
        self.chance = np.random.default_rng(seed)
        self.time = np.arange(0.0, END, 0.002)
        flown = (self.time > 5.0) & (self.time < 35.0)
        self.airborne = flown
        self.place, self.velocity, acceleration = self._motion(self.time)
        self.push = acceleration + np.array([0.0, 0.0, GRAVITY])
        self.R_wb = attitudes_along(self.push)
        noise = self.chance.normal(size=(len(self.time), 3))
        self.felt = np.einsum("nji,nj->ni", self.R_wb, self.push) + 0.1 * noise
        self.rates = _rates(self.R_wb) + 0.003 * self.chance.normal(size=(len(self.time), 3))
        self.thrust = MASS * np.linalg.norm(self.push, axis=1)
        self.torque = np.zeros((len(self.time), 3))
        self.poses, self.frames = self.time[::5], self.time[::16]
        self.tracked = self.place[::5] + 0.0005 * self.chance.normal(size=(len(self.poses), 3))
        self.tracked_R_wb = self.R_wb[::5]
        beacons = parse_layout("paper")
        self.ids = beacons.ids.tolist()
        away = beacons.positions_w[None] - self.place[::16, None]
        seen = np.einsum("nji,nkj->nki", self.R_wb[::16], away)
        self.exact = seen / np.linalg.norm(seen, axis=2, keepdims=True)
        self.seen = self.scattered(self.exact)
        self.pressure = 101_000.0 - 11.8 * self.place[::20, 2]
        self.pressure += 2.0 * self.chance.normal(size=len(self.pressure))

    def _motion(self, time: Array) -> tuple[Array, Array, Array]:
        """Return place, velocity and acceleration of an 8 of 8 s, 1 m above the ground."""
        w = 2.0 * np.pi / 8.0
        size, turn = np.array([1.0, 0.5, 0.05]), np.array([w, 2.0 * w, 3.0 * w])
        angle = time[:, None] * turn
        at = size * np.sin(angle) + [0.0, 0.0, 1.0]
        return at, size * turn * np.cos(angle), -size * turn**2 * np.sin(angle)

    def scattered(self, seen: Array, sigma: float = SIGMA) -> Array:
        moved: Array = seen + sigma * self.chance.normal(size=seen.shape)
        moved /= np.linalg.norm(moved, axis=2, keepdims=True)
        return moved

    def topics(self) -> dict[str, Series]:
        near = np.searchsorted(self.poses, self.time).clip(max=len(self.poses) - 1)
        state = named(POSITION, self.tracked[near])  # an estimate that believes the tracker
        state |= named(ATTITUDE, _quaternions(self.tracked_R_wb[near]))
        poses = named(TRACKED, self.tracked)
        poses |= named(TRACKED_ATTITUDE, _quaternions(self.tracked_R_wb))
        own = named(POSITION, self.place[::16]) | named(ATTITUDE, _quaternions(self.R_wb[::16]))
        bearings: dict[str, Any] = {"sigma": SIGMA}
        for k, id in enumerate(self.ids):
            names = (f"bearings[{k}].x", f"bearings[{k}].y", f"bearings[{k}].z")
            bearings |= {f"beacon_ids[{k}]": float(id), **named(names, self.seen[:, k])}
        torque = named(("torque.x", "torque.y", "torque.z"), self.torque)
        return {
            "imu": Columns(self.time, named(FORCE, self.felt) | named(RATE, self.rates)),
            "state": Columns(self.time, state),
            "actuators": Columns(self.time, {"thrust": self.thrust, "scaling": 1.0, **torque}),
            "tracker_pose": Columns(self.poses, poses),
            "bearings": Columns(self.frames, bearings),
            "bearing_pose": Columns(self.frames, own),
            "pressure": Columns(self.time[::20], {"fluid_pressure": self.pressure}),
            "status": Columns(self.time[::50], {"airborne": self.airborne[::50]}),
        }


def attitudes_along(push: Array) -> Array:
    """Return attitudes (N, 3, 3) without yaw whose z_B is along the thrust."""
    z = push / np.linalg.norm(push, axis=1, keepdims=True)
    y = np.cross(z, [1.0, 0.0, 0.0])
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([np.cross(y, z), y, z], axis=2)


def _rates(R_wb: Array) -> Array:
    """Return the rates (rad/s), (N, 3), body axes, by central differences."""
    change = np.gradient(R_wb, 0.002, axis=0)
    skew = np.einsum("nji,njk->nik", R_wb, change)
    return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)


def _quaternions(R_wb: Array) -> Array:
    """Return w, x, y, z (N, 4) of attitudes that are tilted by less than 90°."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R_wb, axis1=1, axis2=2))
    x = (R_wb[:, 2, 1] - R_wb[:, 1, 2]) / (4.0 * w)
    y = (R_wb[:, 0, 2] - R_wb[:, 2, 0]) / (4.0 * w)
    z = (R_wb[:, 1, 0] - R_wb[:, 0, 1]) / (4.0 * w)
    return np.stack([w, x, y, z], axis=1)
