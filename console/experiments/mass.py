"""The first experiment of Sec. 7: a vehicle takes off with an unknown mass and estimates it.

It flies on the estimate (eqs. 6 to 10), which starts too low: the take-off is delayed until the
height error compensates for it, and then the estimate converges within a second. Erratic flight at
random velocities afterwards shows how noisy it is.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from console.evaluation.mass import DEVIATION_MAX, read_mass
from console.evaluation.thrust_curve import read_thrust_curve
from console.experiments.calibration_flight import CLEAR, CalibrationFlight, CalibrationResult
from console.experiments.client import Client, VehicleView
from console.experiments.manoeuvres import arm, brake, come_down, wait_ready
from console.experiments.readings import Progress
from console.experiments.stick_sequences import RATE, SPEEDS, scripted
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter

USED_BY, INITIAL = "mass.used_by", "mass.initial"
STICK_SPEEDS = (
    "behavior.joy_speed_xy",
    "behavior.joy_speed_xy",
    "behavior.joy_speed_z",
    "behavior.joy_yaw_rate",
)
STEPS = 4
HOVER = (5.0, 25.0)
"""Shortest and longest hover after the climb, s; it ends once the estimate has converged."""
FAR = 1.6
"""Distance in m from the hover position beyond which the erratic flight ends."""


class MassOptions(Parameters):
    """Options of the flight."""

    initial: float = parameter(1.0, unit="kg", ge=0.5, le=2.4, step=0.05)
    """what the estimate begins with; above the true mass it jumps off the ground"""
    height: float = parameter(1.0, unit="m", ge=0.6, le=1.9, step=0.1)
    """of take-off"""
    climb: float = parameter(0.1, unit="m/s", ge=0.05, le=0.5, step=0.05)
    """speed of the take-off"""
    duration: float = parameter(30.0, unit="s", ge=0.0, le=600.0, step=1.0)
    """of the erratic flight"""
    seed: int = parameter(1, ge=0, le=2**31 - 1, step=1)
    """of the erratic flight"""
    weighed: float = parameter(0.0, unit="kg", ge=0.0, le=4.0, step=0.001)
    """mass on the scales, from which the motor law about hover is found instead; 0: not weighed"""


class MassExperiment(CalibrationFlight):
    """Take-off on a low estimate, hover until it has converged, erratic flight, landing."""

    name = "mass"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = MassOptions()
        super().__init__(vehicle)

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        p = self.parameters
        return 30.0 + p.height / p.climb + p.duration

    # ------------------------------------------------------------------ flight
    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses.

        The mass that the control law uses is restored after landing, also when the flight failed.
        When a person took over, no more commands may be sent: the law keeps using the estimate,
        with its initial value restored.
        """
        p = self.parameters
        wait_ready(client)
        client.confirm(CLEAR)
        found = {name: client.parameter(name) for name in (USED_BY, INITIAL)}
        client.change({USED_BY: "estimate", INITIAL: p.initial})
        try:
            try:
                self._fly(client, found)
            except RefusedError:
                come_down(client)
                raise
            come_down(client)
        finally:
            self._restore(client, found)

    def _fly(self, client: Client, found: dict[str, ParameterValue]) -> None:
        p = self.parameters
        arm(client)
        patience = p.height / p.climb + 10.0
        client.start("take_off", height=p.height, speed=p.climb)
        try:
            self._until(
                client,
                lambda v: v.airborne,
                "Keep clear: it takes off on its own, held back by the low estimate",
                1,
                patience,
                "lift-off",
            )
        except RefusedError as error:
            raise RefusedError(
                f"{error}. An initial mass of {p.initial:g} kg and a climb of {p.height:g} m give "
                "too little thrust: try a larger initial mass or height"
            ) from error
        # For the next arming: after a take-over it must not start too light again.
        client.change({INITIAL: found[INITIAL]})
        self._until(
            client,
            lambda v: v.behavior == "hover",
            "It climbs while the mass is estimated",
            2,
            patience,
            "hover after take-off",
        )
        start = client.view().time
        self._until(
            client,
            lambda v: (
                v.time >= start + HOVER[0]
                and (v.mass_deviation <= DEVIATION_MAX or v.time >= start + HOVER[1])
            ),
            "It hovers until the estimate has converged",
            3,
            HOVER[1] + 5.0,
            "convergence",
        )
        if p.duration and not client.finished:
            self._erratic(client)

    def _erratic(self, client: Client) -> None:
        """Fly at the speeds of the sequence, independent of the vehicle's full-stick speed."""
        p = self.parameters
        full = [float(client.parameter(name)) for name in STICK_SPEEDS]
        sequence = np.clip(scripted(p.seed, p.duration) * SPEEDS / full, -1.0, 1.0)
        client.start("velocity")
        place = client.view().position_w
        for k, axes in enumerate(sequence):
            client.sticks(axes.tolist())
            client.wait(1.0 / RATE)
            view = client.view()
            if k % 10 == 0:
                _show_progress(client, view, "It flies around: keep clear", 4, k / len(sequence))
            if client.finished or view.behavior != "velocity":
                break
            if np.linalg.norm(view.position_w - place) > FAR:
                raise RefusedError(f"more than {FAR:g} m from where it hovered: ended")
        if client.view().behavior == "velocity":
            brake(client)

    def _until(
        self,
        client: Client,
        condition: Callable[[VehicleView], bool],
        instruction: str,
        number: int,
        timeout: float,
        what: str,
    ) -> None:
        """Wait with progress; the vehicle's own landing ends it. Raises RefusedError."""
        start = client.view().time
        shown_at = -1.0

        def check(view: VehicleView) -> bool:
            nonlocal shown_at
            if view.time >= shown_at + 0.2:
                shown_at = view.time
                share = min(1.0, (view.time - start) / timeout)
                _show_progress(client, view, instruction, number, share)
            if not view.armed:
                raise RefusedError(f"the motors are off while it waited for {what}")
            return condition(view) or client.finished

        client.wait_until(check, what=what, timeout=timeout)

    def _restore(self, client: Client, found: dict[str, ParameterValue]) -> None:
        with suppress(RefusedError):  # not on the ground: parameters stay as they are
            client.change(found)

    # ------------------------------------------------------------------ judgement
    def found(self, log: Path) -> CalibrationResult:
        """Return the mass for model.mass; of a vehicle that was weighed, the motor law."""
        if weighed := self.parameters.weighed:
            return read_thrust_curve(log, self._vehicle, weighed)
        return read_mass(log, self._vehicle)


def _show_progress(client: Client, view: VehicleView, text: str, number: int, share: float) -> None:
    live = {"mass": (view.mass, "kg"), "mass deviation": (view.mass_deviation, "kg")}
    client.tell(Progress(text, number, STEPS, share, live))
