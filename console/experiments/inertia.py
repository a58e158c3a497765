"""The inertia about three axes (Sec. 5.4), from doublets of the reference in hover.

A doublet to the side tilts the vehicle there and back, a doublet of the yaw turns it: each requires
a torque about one axis that changes its sign, and none moves the vehicle far. The vehicle itself
ends an excitation that leaves its path (behavior `excite`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from console.evaluation.inertia import read_inertia
from console.experiments.calibration_flight import CLEAR, CalibrationFlight, CalibrationResult
from console.experiments.client import Client, VehicleView
from console.experiments.manoeuvres import arm, come_down, take_off, wait_ready
from console.experiments.readings import Progress
from quadrotor.errors import Refusal, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter

AXES = ("x", "y", "yaw")
REPEATS = 3
LEVELS = 3
"""Number of levels of a doublet: to one side, to the other, back."""
LEAD = 0.5
"""Seconds of rest before the first doublet."""
REST = 1.2
"""Seconds between two excitations."""
PATIENCE = 10.0
"""Seconds that the vehicle has to come to rest."""
FAR = 1.0
"""Distance in m from the hover position, in any direction, beyond which the experiment ends."""
NEAR_GROUND = 0.5
"""The same limit downwards, m."""
SHAPES = {"slow": (0.25, 0.4, 0.8), "quick": (0.2, 0.4, 0.4)}
"""Amplitude in m and in rad, and seconds per level."""
RANDOM = ((0.12, 0.25), (0.3, 0.5), (0.3, 0.7))
"""Lowest and highest values of the same three."""


class InertiaOptions(Parameters):
    """Options of the excitation."""

    excitation: str = parameter("random", choices=(*SHAPES, "random"))
    """doublets of 0.8 s a level, of 0.4 s, or of random size and time"""
    seed: int = parameter(1, ge=0, le=2**31 - 1, step=1)
    """of the random ones"""
    rounds: int = parameter(2, ge=2, le=10, step=1)
    """how often all three axes are excited"""
    height: float = parameter(1.2, unit="m", ge=1.0, le=1.5, step=0.1)
    """of the hover"""
    size: float = parameter(1.0, ge=0.3, le=1.5, step=0.1)
    """of all amplitudes over the usual ones"""


class ExcitedFlight(CalibrationFlight):
    """Take-off, excitations of the axes in hover, landing; estimated from every tick."""

    def __init__(self, vehicle: str = "quad1") -> None:
        super().__init__(vehicle)
        self._place: tuple[float, float, float] | None = None

    def excitations(self) -> list[dict[str, ParameterValue]]:
        """Return the arguments of each `excite` in order."""
        raise NotImplementedError

    def abort(self, view: VehicleView) -> str:
        """Return why the experiment has to end, as text."""
        if self._place is None or not view.airborne:
            return ""
        away = view.position_w - np.array(self._place)
        if not float(np.linalg.norm(away)) <= FAR:
            return f"{np.linalg.norm(away):.1f} m from where it hovered, {FAR:g} m are allowed"
        if away[2] < -NEAR_GROUND:
            return f"{-away[2]:.1f} m below where it hovered, {NEAR_GROUND:g} m are allowed"
        return ""

    # ------------------------------------------------------------------ flight
    def fly_at(self, client: Client, height: float) -> None:
        """Excite the axes at a height (m). Raises RefusedError with the vehicle's reason when it
        refuses, or ends an excitation by itself.
        """
        self._place = None
        wait_ready(client)
        client.confirm(CLEAR)
        steps = self.excitations()
        client.tell(Progress("Keep clear: it takes off on its own", 1, len(steps) + 2))
        arm(client)
        try:
            take_off(client, height)
            client.wait(2.0)
            x, y, z = client.view().position_w.tolist()
            self._place = (x, y, z)
            for k, one in enumerate(steps):
                if client.finished:
                    break
                client.tell(Progress(_words(one), k + 2, len(steps) + 2, k / len(steps)))
                self._excite(client, one)
        except RefusedError:
            self._land(client)
            raise
        client.tell(Progress("It lands", len(steps) + 2, len(steps) + 2))
        self._land(client)

    def _excite(self, client: Client, arguments: dict[str, ParameterValue]) -> None:
        self._begin(client, arguments)
        begun, planned = client.view().time, _duration(arguments)
        client.wait_until(
            lambda v: v.behavior != "excite" or client.finished,
            what="the end of the excitation",
            timeout=planned + 5.0,
        )
        view = client.view()
        if view.behavior == "excite":  # finished early
            client.start("brake")
        elif view.behavior not in ("hover", "brake"):
            raise RefusedError(f"the excitation gave way to {view.behavior}")
        elif view.time - begun < planned - 0.5:
            raise RefusedError(
                f"the vehicle ended the excitation of {arguments['axis']} by itself after "
                f"{view.time - begun:.1f} of {planned:.1f} s; the events of the run say which "
                "limit it left: try a smaller size"
            )
        client.wait(REST)

    def _begin(self, client: Client, arguments: dict[str, ParameterValue]) -> None:
        """Begin once the vehicle is at rest. Raises RefusedError when it never is, or for another
        reason.
        """
        until = client.view().time + PATIENCE
        while True:
            try:
                client.start("excite", **arguments)
            except RefusedError as error:
                if error.kind != Refusal.NOT_AT_REST or client.view().time > until:
                    raise
                client.wait(0.5)
            else:
                return

    def _land(self, client: Client) -> None:
        self._place = None
        come_down(client)

    # ------------------------------------------------------------------ judgement
    def found(self, log: Path) -> CalibrationResult:
        """Return the three inertias for model.inertia_xx, _yy, _zz."""
        return read_inertia(log, self._vehicle)


class InertiaExperiment(ExcitedFlight):
    """Doublets about three axes in turns, of fixed or of random size."""

    name = "inertia"

    def __init__(self, vehicle: str = "quad1") -> None:
        super().__init__(vehicle)
        self.parameters = InertiaOptions()

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        return 20.0 + sum(_duration(one) + REST for one in self.excitations())

    def fly(self, client: Client) -> None:
        self.fly_at(client, self.parameters.height)

    def excitations(self) -> list[dict[str, ParameterValue]]:
        """Return the arguments of each `excite` in order; the same seed gives the same."""
        p = self.parameters
        random = np.random.default_rng(p.seed)
        out: list[dict[str, ParameterValue]] = []
        for k in range(3 * p.rounds):
            axis = AXES[k % 3]
            move, turn, time = SHAPES.get(p.excitation, (0.0, 0.0, 0.0))
            if p.excitation == "random":
                move, turn, time = (float(random.uniform(*span)) for span in RANDOM)
                move, turn = np.copysign((move, turn), random.uniform(-1.0, 1.0)).tolist()
            out.append(
                {
                    "axis": axis,
                    "shape": "doublet",
                    "amplitude": round(p.size * (turn if axis == "yaw" else move), 3),
                    "duration": round(time, 1),
                    "repeats": REPEATS,
                }
            )
        return out


def _duration(arguments: dict[str, ParameterValue]) -> float:
    """Return the duration of one excitation, s."""
    return LEAD + int(arguments["repeats"]) * LEVELS * float(arguments["duration"])


def _words(arguments: dict[str, ParameterValue]) -> str:
    axis, size = arguments["axis"], abs(float(arguments["amplitude"]))
    if axis == "yaw":
        return f"It yaws back and forth by {size:.2f} rad"
    return f"It moves back and forth along {axis} by {size:.2f} m"
