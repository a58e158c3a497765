"""RotorPy's controller alone and its own closed loop, on its own 8 (Folk, Paulos, Kumar 2023)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


class RotorPy:
    """Hummingbird with SE3Control at 1 kHz. Raises ImportError when it is not installed."""

    def __init__(self) -> None:
        from rotorpy.controllers.quadrotor_control import SE3Control
        from rotorpy.environments import Environment
        from rotorpy.trajectories.lissajous_traj import TwoDLissajous
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor

        rate = 2.0 * math.pi / 8.0
        trajectory = TwoDLissajous(A=0.5, B=0.5, a=rate, b=2.0 * rate, height=1.0)
        flat: dict[str, Any] = trajectory.update(0.0)
        hover = math.sqrt(quad_params["mass"] * 9.81 / (4.0 * quad_params["k_eta"]))
        self._state = {
            "x": flat["x"],
            "v": flat["x_dot"],
            "q": np.array([0.0, 0.0, 0.0, 1.0]),
            "w": np.zeros(3),
            "wind": np.zeros(3),
            "rotor_speeds": np.full(4, hover),
        }
        self._flat = flat
        self._controller = SE3Control(quad_params)
        vehicle = Multirotor(quad_params, initial_state=self._state)
        self._environment = Environment(vehicle, SE3Control(quad_params), trajectory, sim_rate=1000)

    def update(self) -> None:
        """Run one SE3Control.update."""
        self._controller.update(0.0, self._state, self._flat)

    def fly(self, seconds: float) -> tuple[int, float]:
        """Return the number of steps of 1 ms and the rms position error, m."""
        result = self._environment.run(t_final=seconds, plot=False)
        error = result["state"]["x"] - result["flat"]["x"]
        return len(result["time"]) - 1, float(np.sqrt((error**2).sum(axis=1).mean()))
