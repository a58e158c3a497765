"""The policy RAPTOR as a law: motor commands by a recurrent network (Eschmann et al. 2025).

Its weights are the package `foundation-policy`, MIT. It was trained on vehicles with rotors at the
corners, for position and yaw at rest; a reference is followed by giving it the differences.
"""

from __future__ import annotations

import math

import numpy as np

from quadrotor.records import Array, Record
from quadrotor.rotations import quaternion_to_matrix

EVERY = 5
"""Ticks of 2 ms for one step of the policy, which was trained at 10 ms."""
CORNERS = (0, 3, 2, 1)
"""The vehicle's rotors in the policy's order: front right, back right, back left, front left. Axes
turned by 45° to the left have the front rotor at the right, the left one at the left."""
TURN = math.radians(45.0)


class Raptor:
    """The policy, for thrusts between two ends. Raises ImportError when it is not installed.

    Args:
        least, most: N, of a rotor.
    """

    def __init__(self, least: float, most: float) -> None:
        from foundation_policy import Raptor as Policy

        self._policy = Policy()
        self._policy.reset()
        self._ends = math.sqrt(least), math.sqrt(most)
        self._action = np.zeros(4)
        self._tick = 0

    def step(self, state: Record, reference: Record, actuators: Record) -> None:
        """Compute the actuators of a tick; all records have the shape (1,)."""
        if self._tick % EVERY == 0:
            self._action = self._policy.evaluate_step(self._seen(state, reference))[0]
            low, high = self._ends
            roots = low + 0.5 * (self._action + 1.0) * (high - low)
            actuators["thrusts"][0, list(CORNERS)] = np.square(roots)
        self._tick += 1

    def _seen(self, state: Record, reference: Record) -> Array:
        """Return position, attitude, velocity, angular velocity and last action (1, 22).

        All are relative to the reference, in axes turned by its yaw and 45°.
        """
        s, r = state[0], reference[0]
        frame, corner = _about_z(float(r["yaw"]) + TURN), _about_z(TURN)
        attitude = frame.T @ quaternion_to_matrix(s["quaternion_wb"]) @ corner
        return np.concatenate(
            (
                frame.T @ (s["position_w"] - r["position_w"]),
                attitude.ravel(),
                frame.T @ (s["velocity_w"] - r["velocity_w"]),
                corner.T @ s["angular_velocity_b"],
                self._action,
            )
        )[None]


def _about_z(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
