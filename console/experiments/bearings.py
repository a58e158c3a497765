"""Flight on bearings to beacons alone (Secs. 6.2 and 7, Fig. 6), with hand-overs in flight.

The vehicle takes off on the tracker, an estimator runs in parallel on the bearings until the
vehicle accepts it, a manoeuvre is flown on it, and the tracker takes over again for the landing.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.bearings import read_flight
from console.evaluation.bearings_limits import limits
from console.evaluation.verdict import judged
from console.evaluation.world import read_world
from console.experiments.client import Client, Result
from console.experiments.manoeuvres import arm, brake, take_off, wait_landed, wait_ready
from console.experiments.stick_sequences import RATE, recorded, scripted
from control.presets import PRESETS as CONTROL_PRESETS
from control.presets import preset_values
from estimation.parameters import PRESETS as ESTIMATION_PRESETS
from quadrotor.errors import RefusedError, UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter

RAMP = 4.0
"""Seconds, longer than the 8's ramp in or out."""
SETTLE = 2.0
"""Seconds between the hand-over and the manoeuvre."""
PERIOD = 8.0
PATIENCE = 40.0
"""Seconds for which the hand-over is requested."""


class BearingsOptions(Parameters):
    """Options: the manoeuvre and the source of measurements."""

    manoeuvre: str = parameter("hover", choices=("hover", "figure_eight", "sticks", "manual"))
    """flown on bearings; sticks are scripted, or those of sticks_file; manual is flown by a person
    from the page"""
    duration: float = parameter(60.0, unit="s", ge=5.0, le=3600.0, step=1.0)
    """of the manoeuvre, at least"""
    height: float = parameter(1.0, unit="m", ge=0.4, le=1.9, step=0.1)
    """of take-off"""
    estimator: str = parameter("error_state", choices=("error_state", "complementary"))
    """flown on while the tracker is not"""
    gains: str = parameter("auto", choices=("auto", "as_set", *ESTIMATION_PRESETS))
    """of the complementary filter on bearings; auto is resolved, as_set leaves those of
    estimation.*"""
    control: str = parameter("as_set", choices=("as_set", *CONTROL_PRESETS))
    """gains of the control while on bearings; as_set leaves those of control.*"""
    sticks_file: str = parameter("")
    """CSV with the columns t,forward,left,up,yaw; empty for scripted sticks"""
    sticks_seed: int = parameter(1, ge=0, le=2**31 - 1, step=1)
    """of the scripted sticks"""


class BearingsExperiment:
    """Take-off on the tracker, hand-over, manoeuvre, back, landing; judged on the manoeuvre."""

    name = "bearings"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = BearingsOptions()
        self._vehicle = vehicle

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s: take-off, hand-over, manoeuvre, landing."""
        p = self.parameters
        file = p.manoeuvre == "sticks" and p.sticks_file
        return 25.0 + (len(self._sticks()) / RATE if file else p.duration)

    def check(self) -> None:
        """Raise UsageError for inconsistent options, StorageError for a missing file."""
        p = self.parameters
        if p.gains not in ("auto", "as_set") and p.estimator != "complementary":
            raise UsageError(
                f"experiment.gains={p.gains} is of the complementary filter; "
                f"experiment.estimator is {p.estimator}"
            )
        if p.manoeuvre == "sticks":
            self._sticks()

    # ------------------------------------------------------------------ flight
    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses, or as `check` does.

        The manoeuvre ends when the vehicle returns to the tracker or lands by itself.
        """
        p = self.parameters
        self.check()
        if p.manoeuvre == "manual" and not client.has_pilot:
            raise UsageError(
                "experiment.manoeuvre=manual needs a person at the sticks: start it from the "
                "page, or fly experiment.manoeuvre=sticks, scripted or with experiment.sticks_file"
            )
        sticks = self._sticks() if p.manoeuvre == "sticks" else np.empty((0, 4))
        wait_ready(client)
        before = {name: client.parameter(name) for name in self._control_gains()}
        found = {name: client.parameter(name) for name in self._changed_on_board()}
        client.change(self._shadow())  # compiled on the ground, restarted in the air
        client.change({"estimation.shadow": "none"})
        arm(client)
        take_off(client, p.height)
        try:
            self._hand_over(client)
        except RefusedError:
            self._land(client)
            raise
        if not client.finished:
            client.wait(SETTLE)
            self._manoeuvre(client, sticks)
        if self._on_bearings(client):
            with suppress(RefusedError):  # without a tracker it lands on bearings
                client.change({"estimation.source": "poses"})
        client.change(before)
        client.wait(1.0)
        self._land(client)
        with suppress(RefusedError):  # not on the ground: parameters stay as they are
            client.change(found)

    def _land(self, client: Client) -> None:
        if client.view().mode == "armed":
            client.start("land")
        wait_landed(client, 20)

    def _hand_over(self, client: Client) -> None:
        p = self.parameters
        client.change(self._estimator_gains() | self._shadow() | self._control_gains())
        patient_until = client.view().time + PATIENCE
        while not client.finished:
            client.wait(0.5)
            try:
                client.change(
                    {"estimation.estimator": p.estimator, "estimation.source": "bearings"}
                )
                break
            except RefusedError:
                if client.view().time > patient_until:
                    raise
        if p.gains == "paper" and self._on_bearings(client):
            # Noisier than the vehicle would ever accept, so set only after the hand-over.
            paper = {f"estimation.{k}": v for k, v in ESTIMATION_PRESETS["paper"].items()}
            client.change({**paper, "fallback.enabled": False})

    def _manoeuvre(self, client: Client, sticks: npt.NDArray[np.float64]) -> None:
        p = self.parameters
        if p.manoeuvre == "figure_eight":
            laps = max(1, round(p.duration / PERIOD))
            client.start("follow_trajectory", trajectory="figure_eight", laps=laps, period=PERIOD)
            client.wait_until(
                lambda v: v.behavior != "follow_trajectory" or self._over(client),
                what="the end of the 8",
                timeout=(laps + 2) * PERIOD + 10,
            )
            if client.view().behavior == "follow_trajectory":
                brake(client)
        elif p.manoeuvre == "sticks":
            client.start("velocity")
            for axes in sticks:
                client.sticks(axes)
                client.wait(1.0 / RATE)
                if self._over(client) or client.view().behavior != "velocity":
                    break
            self._brake(client)
        elif p.manoeuvre == "manual":
            client.start("velocity")
            client.pilot_flies(True)
            end = client.view().time + p.duration
            try:
                client.wait_until(
                    lambda v: v.time >= end or v.behavior != "velocity" or self._over(client),
                    what="the end of the flight by hand",
                    timeout=p.duration + 5.0,
                )
            finally:
                client.pilot_flies(False)
            self._brake(client)
        else:
            end = client.view().time + p.duration + RAMP
            client.wait_until(
                lambda v: v.time >= end or v.mode != "armed" or self._over(client),
                what="the end of hover",
                timeout=p.duration + RAMP + 5.0,
            )

    def _brake(self, client: Client) -> None:
        if client.view().behavior == "velocity":
            brake(client)

    def _over(self, client: Client) -> bool:
        """Return whether the manoeuvre is to end: on request, or because the vehicle no longer
        flies on bearings.
        """
        return client.finished or not self._on_bearings(client)

    def _sticks(self) -> npt.NDArray[np.float64]:
        p = self.parameters
        if p.sticks_file:
            return recorded(Path(p.sticks_file))
        return scripted(p.sticks_seed, p.duration)

    def _estimator_gains(self) -> dict[str, ParameterValue]:
        p = self.parameters
        if p.estimator != "complementary":
            return {}
        gains = ESTIMATION_PRESETS.get("resolved" if p.gains in ("auto", "paper") else p.gains, {})
        return {f"estimation.{name}": value for name, value in gains.items()}

    def _changed_on_board(self) -> tuple[str, ...]:
        """Return the names of the parameters restored after landing."""
        papers = self.parameters.gains == "paper"
        extra = [f"estimation.{name}" for name in ESTIMATION_PRESETS["paper"]] if papers else []
        return (
            "estimation.estimator",
            "estimation.shadow",
            "estimation.shadow_source",
            *dict.fromkeys((*self._estimator_gains(), *extra)),
            *(("fallback.enabled",) if papers else ()),
        )

    def _shadow(self) -> dict[str, ParameterValue]:
        return {
            "estimation.shadow": self.parameters.estimator,
            "estimation.shadow_source": "bearings",
        }

    def _control_gains(self) -> dict[str, ParameterValue]:
        if self.parameters.control == "as_set":
            return {}
        return preset_values(self.parameters.control)

    def _on_bearings(self, client: Client) -> bool:
        return client.parameter("estimation.source") == "bearings"

    # ------------------------------------------------------------------ the log
    def evaluate(self, log: Path) -> Result:
        """Judge the errors on bearings relative to what the sensor allows. Raises
        LogFormatError.
        """
        p = self.parameters
        flight = read_flight(log, self._vehicle, RAMP)
        gains = p.gains if p.estimator == "complementary" else "auto"
        world, (allowed, deciding, why) = read_world(log), limits(flight.bound, p.estimator, gains)
        figures = flight.metrics() | world.metrics()
        return judged(figures, world.widened(allowed), deciding, why)

    def report(self, log: Path, folder: Path) -> list[Path]:
        """Write the plots of Fig. 6 and the figures. Raises UsageError without matplotlib."""
        from console.evaluation.bearings_report import write

        flight = read_flight(log, self._vehicle, RAMP)
        return write(flight, self.parameters, self.evaluate(log), folder / log.stem)
