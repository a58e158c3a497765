"""Matrix T and bias b of the accelerometer from poses held still (Sec. 5.2).

A pose is stored automatically once the vehicle was still for long enough; the guide then shows the
next one until the poses determine the result. Its attitude is the tracker's, or that of the face it
rests on.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from console.evaluation.accelerometer import (
    RESIDUAL_MAX,
    Held,
    InForce,
    identify,
    raw_of,
    record_of,
    up_of,
)
from console.evaluation.verdict import judged
from console.experiments.client import Client, Result, VehicleView
from console.experiments.manoeuvres import wait_ready
from console.experiments.pose_guide import attitude_of, face_up, farthest, spread_poses, words_of
from console.experiments.readings import Progress
from estimation.calibration.accelerometer import CONDITION_MAX, FACES, Coverage, coverage, face_of
from estimation.calibration.still_poses import StillPose, StillPoses
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import MeasurementError, QuadlabError, RefusedError
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Array

LOOK = 0.02
"""Seconds between two reads of the samples."""
LISTEN = 0.5
"""Seconds in which the sample rate is measured."""
MOST = 3
"""Multiple of the requested number of poses after which no more are requested."""


class AccelerometerOptions(Parameters):
    """Options: the source of attitudes, and the number of poses."""

    method: str = parameter("tracker", choices=("tracker", "faces"))
    """attitudes by the tracker, in any poses; or, without a tracker, by the six faces it is placed
    on"""
    poses: int = parameter(12, ge=4, le=40, step=1)
    """with the tracker; the faces are six"""
    tilt: float = parameter(70.0, unit="°", ge=20.0, le=90.0, step=5.0)
    """from upright, of the poses that are asked for; the tracker must see them"""
    hold: float = parameter(1.0, unit="s", ge=0.3, le=10.0, step=0.1)
    """a pose must be still for so long"""
    patience: float = parameter(120.0, unit="s", ge=5.0, le=3600.0, step=5.0)
    """without a new pose, after which it ends"""
    attitude_noise: float = parameter(0.2, unit="°", ge=0.01, le=5.0, step=0.05)
    """standard deviation of the tracker's attitude in a pose"""


@dataclass
class _Progress:
    """The progress so far: the held poses."""

    finder: StillPoses
    since: float  # s, time of the newest pose
    target: Array  # world z in body axes of the next pose
    ups: list[Array] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    known: Coverage = field(default_factory=lambda: coverage(np.empty((0, 3))))
    note: str = ""
    moving: str = ""
    share: float = 0.0
    begun: float = math.nan  # s, start of the present stillness


class Accelerometer:
    """Guides a person through poses; judged on the residuals and on how well the poses determine
    the result.
    """

    name = "accelerometer"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = AccelerometerOptions()
        self._vehicle = vehicle
        self._in_force: InForce | None = None
        self._held: list[Held] = []
        self._simulated = False

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s; a person is slower."""
        return 5.0 + self._count * (self.parameters.hold + 4.0)

    def check(self) -> None:
        """Accept all options: every combination is valid."""

    @property
    def _count(self) -> int:
        return len(FACES) if self.parameters.method == "faces" else self.parameters.poses

    # ------------------------------------------------------------------ the procedure
    def fly(self, client: Client) -> None:
        """Guide through the poses. Raises RefusedError when motors are on, or no pose is held in
        time.
        """
        wait_ready(client)
        self._in_force, self._held = InForce.of(client.parameter), []
        self._simulated = client.simulated
        client.tell(Progress("Take the vehicle in your hands; its motors stay off"))
        client.imu()
        client.wait(LISTEN)
        samples = len(client.imu().time)
        if samples < 2:
            raise RefusedError(
                f"no samples of the IMU arrived within {LISTEN:g} s; check the link, then begin "
                "again"
            )
        finder = StillPoses(samples / LISTEN, duration=self.parameters.hold)
        state = _Progress(finder, client.view().time, self._next([], []))
        try:
            self._collect(client, state)
            client.tell(Progress("Set the vehicle down, level", self._count, self._count, 1.0))
        finally:
            with suppress(QuadlabError):  # the reason for the end matters more
                client.turn(None)

    def _collect(self, client: Client, state: _Progress) -> None:
        client.turn(attitude_of(state.target))
        live = self._live(state)
        while not (client.finished or self._is_complete(state)):
            how = self._words(state.target)
            instruction = f"{state.note}. {how}" if state.note else how
            number = min(len(state.ups) + 1, self._count)
            client.tell(Progress(instruction, number, self._count, state.share, live))
            client.wait(LOOK)
            self._refuse(client.view(), state)
            if self._add_samples(client, state):
                state.known = coverage(np.array([pose.measured for pose in state.finder.poses]))
                state.target = self._next(state.ups, state.faces)
                live = self._live(state)
                if not self._is_complete(state):
                    client.turn(attitude_of(state.target))

    def _refuse(self, view: VehicleView, state: _Progress) -> None:
        if view.armed or view.mode != "ready":
            raise RefusedError(
                f"the vehicle is {view.mode}; motors must be off while it is held. Disarm it and "
                "begin again"
            )
        patience = self.parameters.patience
        if view.time - state.since > patience:
            why = state.moving or state.note or "it was not turned to another pose"
            raise RefusedError(
                f"no new pose was held still for {patience:g} s ({why}); {len(state.ups)} were "
                "taken, which is not enough. Nothing was changed; begin again"
            )

    def _add_samples(self, client: Client, state: _Progress) -> bool:
        """Add the samples since the last call; return whether they complete a pose."""
        assert self._in_force is not None
        readings, seen = client.imu(), None
        if self.parameters.method == "tracker":
            seen = client.tracked()
        up = up_of(seen.quaternion_wb) if seen is not None else None
        raw = raw_of(readings.specific_force_b, self._in_force.matrix, self._in_force.bias)
        is_new = False
        for time, force, rate in zip(
            readings.time.tolist(), raw, readings.angular_velocity_b, strict=True
        ):
            known = len(state.finder.poses)
            still = state.finder.add(force, rate, up)
            state.share, state.moving = still.share, still.moving
            if still.share and math.isnan(state.begun):
                state.begun = time
            if len(state.finder.poses) > known:
                is_new |= self._add_pose(state, state.finder.poses[-1], time)
            if still.share in (0.0, 1.0):  # the stillness starts again
                state.begun = math.nan
        return is_new

    def _add_pose(self, state: _Progress, pose: StillPose, time: float) -> bool:
        """Store a pose, or report why not."""
        face, up = "", pose.up_b
        if self.parameters.method == "faces":
            try:
                face = face_of(pose.measured)
            except MeasurementError as error:
                state.note = str(error)
            else:
                state.note = f"{face!r} is done already" if face in state.faces else ""
            up = None if state.note else face_up(face)
        else:
            state.note = "" if up is not None else "the tracker does not see the vehicle"
        if up is None:
            state.finder.poses.pop()
            return False
        state.ups.append(up)
        state.faces.append(face)
        state.since = time
        self._held.append(Held(state.begun, time, face))
        return True

    def _is_complete(self, state: _Progress) -> bool:
        taken = len(state.ups)
        return taken >= MOST * self._count or (taken >= self._count and not state.known.next_face)

    def _next(self, ups: list[Array], faces: list[str]) -> Array:
        """Return world z in body axes of the next pose."""
        if self.parameters.method == "faces":
            return face_up(next((face for face in FACES if face not in faces), "upright"))
        return farthest(spread_poses(self._count, math.radians(self.parameters.tilt)), ups)

    def _words(self, target: Array) -> str:
        if self.parameters.method == "faces":
            how = next(name for name in FACES if np.allclose(FACES[name], target))
        else:
            how = words_of(target)
        return f"Hold the vehicle still for {self.parameters.hold:g} s: {how}"

    def _live(self, state: _Progress) -> dict[str, tuple[float, str]]:
        live = {"poses": (float(len(state.ups)), ""), "rank": (float(state.known.rank), "")}
        if math.isfinite(state.known.condition_number):
            live["condition number"] = (state.known.condition_number, "")
        for k, up in enumerate(state.ups, 1):
            live |= {f"pose {k} {axis}": (float(up[i]), "") for i, axis in enumerate("xyz")}
        live |= {f"next {axis}": (float(state.target[i]), "") for i, axis in enumerate("xyz")}
        return live

    # ------------------------------------------------------------------ the log
    def evaluate(self, log: Path) -> Result:
        """Judge the calibration. Raises LogFormatError, or MeasurementError with what is
        missing.
        """
        found = identify(log, self._vehicle, self._in_force, self._held, self._noise)
        metrics = {
            "residual_rms_m_s2": found.rms,
            "residual_max_m_s2": float(np.linalg.norm(found.residuals, axis=1).max()),
            "condition_number": found.condition_number,
            "bias_m_s2": float(np.linalg.norm(found.bias)),
            "poses": float(len(found.measured)),
        }
        limits = {"residual_rms_m_s2": RESIDUAL_MAX, "condition_number": CONDITION_MAX}
        return judged(metrics, limits)

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the calibration found. Raises as `evaluate` does."""
        found = identify(log, self._vehicle, self._in_force, self._held, self._noise)
        conditions = {
            "method": self.parameters.method,
            "vehicle": "simulated" if self._simulated else "real",
            "hold": f"{self.parameters.hold:g} s",
        }
        if self.parameters.method == "tracker":
            conditions["attitude noise"] = f"{self.parameters.attitude_noise:g}°"
        return record_of(found, conditions)

    @property
    def _noise(self) -> float:
        """Return the noise of a pose's attitude, rad."""
        return math.radians(self.parameters.attitude_noise)
