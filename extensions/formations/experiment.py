"""Several vehicles take off at random places, converge to a formation, hold it and are steered."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from bearing_sim.sampling import Draws
from console.evaluation.result import Result
from console.experiments.client import Client
from console.experiments.manoeuvres import arm, brake, come_down, take_off, wait_ready
from console.experiments.together import Company
from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.messages import Radio, Whereabouts
from extensions.formations.options import FormationOptions
from extensions.formations.pilot import AS_LATE, STEP, Pilot
from extensions.formations.separation import Guard
from extensions.formations.shape import Shape, shape_of
from extensions.formations.starts import random_starts, starts_near
from extensions.formations.verdict import CUT, ROOM, Windows, judge
from quadrotor.errors import RefusedError, UsageError

GATHERED = 18.0
"""Time, s, at which all hover at their random starts and begin to converge."""
JOINING = 15.0
"""Time, s, that a vehicle which joins from the ground has to climb, turn and converge."""
VOLUME = {
    f"behavior.volume_{axis}_{end}": value
    for end, corner in zip(("min", "max"), ROOM, strict=True)
    for axis, value in zip("xyz", corner, strict=True)
}
LOW, HIGH = 0.9, 1.5
"""Smallest and largest height (m) of the random starts."""
FAST = {"behavior.joy_speed_xy": 1.5}
"""m/s: the law, the commanded speed and the turn about the centroid together."""
SPEEDS = "behavior.joy_speed_xy", "behavior.joy_speed_z", "behavior.joy_yaw_rate"


class FormationExperiment:
    """Judged on the bearings, the separation and the rigidity of the formation."""

    name = "formation"
    vehicles_min, vehicles_max = 3, 8

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = FormationOptions()
        self._vehicle = vehicle
        self._company: Company | None = None
        self._pilot: Pilot | None = None
        self._effort: list[float] = []

    @property
    def planned(self) -> float:
        """Return the duration of the flight in s."""
        return self._windows.end + 10.0

    @property
    def _windows(self) -> Windows:
        p = self.parameters
        held = GATHERED + p.converge + p.hold
        return Windows(GATHERED, GATHERED + p.converge, held, held + p.steered)

    def check(self) -> None:
        """Raise UsageError for bearings that are none, whoever flies."""
        if self._company is not None:
            self._shape(len(self._company.names))

    def start_places(self, count: int, seed: int) -> Sequence[tuple[float, float]]:
        """Return random starts. Raises UsageError for a formation that cannot be flown."""
        for name in ("fails", "joins"):
            if (number := getattr(self.parameters, name)) > count:
                raise UsageError(f"experiment.{name}={number}: there are vehicles 1 to {count}")
        if self.parameters.near:
            return starts_near(self._shape(count).places, seed, self.parameters.near)
        return random_starts(self._shape(count).places, seed, self.parameters.crossing)

    def join(self, company: Company) -> None:
        """Take the place of one vehicle."""
        self._company = company
        shape = self._shape(len(company.names))
        self._pilot = Pilot(company, self.parameters, shape, localises=True)

    def _shape(self, count: int) -> Shape:
        return shape_of(self.parameters.desired, count)

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        if self._company is None or self._pilot is None:
            raise RefusedError("a formation is flown by several vehicles: quadlab fly --vehicles N")
        wait_ready(client)
        client.change({**VOLUME, **FAST})
        draws = Draws(self._company.seed, 77)
        height, turned = LOW + (HIGH - LOW) * draws.uniform(), 2.0 * draws.uniform() - 1.0
        yaw = math.remainder(self._pilot.desired_yaw + self.parameters.turn * turned, math.tau)
        gathered = GATHERED
        if self.parameters.joins == self._company.index + 1:
            self._stay(client, self._pilot.radio, self._windows.converged - JOINING)
            gathered = 0.0
        arm(client)
        take_off(client, height)
        x, y, z = client.view().position_w.tolist()
        client.start("fly_to", x=x, y=y, z=z, yaw=yaw)
        client.wait_until(lambda v: v.behavior == "hover", what="the turn", timeout=10)
        client.wait_until(lambda v: v.time >= gathered, what="the others", timeout=GATHERED)
        self._pilot.radio.has_left = False
        self._fly_formation(client, self._pilot)
        come_down(client)

    def _fly_formation(self, client: Client, pilot: Pilot) -> None:
        windows, p = self._windows, self.parameters
        speed_xy, speed_z, yaw_rate = (float(client.parameter(name)) for name in SPEEDS)
        fails = math.inf
        assert self._company is not None
        if p.fails == self._company.index + 1:
            fails = 0.5 * (windows.converged + windows.held)
        guard, limits = Guard(self._company, pilot.radio), np.array([speed_xy, speed_xy, speed_z])
        client.start("velocity")
        pilot.is_flying, turning = True, 0.0
        while (now := (view := client.view()).time) < windows.end:
            if now >= fails:
                pilot.is_flying = False
                self._leave(client, pilot.radio, windows.end)
                return
            pilot.command = self._command(now - windows.held)
            now_ns, asked = round(1e9 * now), pilot.velocity_y
            kept = guard.keep(asked, view.position_w, now_ns, limits, pilot.commanded_y)
            u, v, w = kept.tolist()
            turning += AS_LATE * (pilot.yaw_rate - turning)
            client.sticks((u / speed_xy, v / speed_xy, w / speed_z, turning / yaw_rate))
            self._effort.append(math.sqrt(u * u + v * v + w * w))
            client.wait(STEP)
        pilot.is_flying = False
        brake(client)

    def _leave(self, client: Client, radio: Radio, end: float) -> None:
        """Land, and broadcast the own place alone until the others land, too."""
        client.start("land")
        self._stay(client, radio, end)

    @staticmethod
    def _stay(client: Client, radio: Radio, end: float) -> None:
        """Fly no part of the formation, and broadcast the own place alone."""
        radio.has_left = True
        last = client.view()
        while last.time < end:
            client.wait(STEP)
            view = client.view()
            u, v, w = ((view.position_w - last.position_w) / (view.time - last.time)).tolist()
            x, y, z = view.position_w.tolist()
            radio.own = Whereabouts(round(1e9 * view.time), (x, y, z), (u, v, w))
            last = view

    def _command(self, since: float) -> NullMotion:
        """Return the null motion of the plan: there and back in all of them, with periods of 6 to
        10 s; none before and after.
        """
        p = self.parameters
        if since < 0.0:
            return NullMotion()

        def swing(largest: float, period: float) -> float:
            return largest * math.cos(2.0 * math.pi * since / period)

        velocity = (swing(p.speed, 6.0), swing(0.5 * p.speed, 7.0), swing(0.2 * p.speed, 5.0))
        return NullMotion(velocity, swing(p.yaw_rate, 8.0), swing(p.scale_rate, 10.0))

    def evaluate(self, log: Path) -> Result:
        """Return the figures of this vehicle alone, which decide nothing."""
        if self._pilot is None or not self._effort:
            raise RefusedError("the formation was not flown")
        effort = math.sqrt(math.fsum(one * one for one in self._effort) / len(self._effort))
        least = self._pilot.least if math.isfinite(self._pilot.least) else 0.0
        metrics = {"effort_m_s": effort, "eigenvalue_min": least}
        if self.parameters.messages.cut:
            metrics[CUT] = self.parameters.messages.cut
        return Result("passed", metrics, {"effort_m_s": 5})

    def judge(self, logs: Mapping[str, Path], results: Mapping[str, Result]) -> Result:
        """Return the result of all vehicles, from the truth in their logs."""
        return judge(self.parameters, self._shape(len(logs)), self._windows, logs, results)

    def report_together(
        self, logs: Mapping[str, Path], results: Mapping[str, Result], joint: Result, folder: Path
    ) -> list[Path]:
        """Return the files of the plots and figures. Raises UsageError without matplotlib."""
        from extensions.formations.report import write

        shape, windows = self._shape(len(logs)), self._windows
        return write(self.parameters, shape, windows, logs, results, joint=joint, folder=folder)
