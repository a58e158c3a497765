"""Scripted vehicle that flies step tests, ten times as fast as a real one, and has their log."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np

from control.parameters import ControlParameters
from control.trajectories.multistep import AXES, LEAD, LEVELS
from extensions.tuning.evaluation import COLUMNS, Plan
from quadrotor.parameters import Parameters, ParameterStore, parameter
from vehicle_link.messages import header, new
from vehicle_link.parameters.messages import from_parameters
from vehicle_link.topics.table import SERVICES

FASTER = 10.0
STEP_NS = 2_000_000
ROWS = 400  # rows of an answer


class _Limits(Parameters):
    excite_position_max: float = parameter(0.6, unit="m", ge=0.05, le=2.0, description="steps")
    excite_yaw_max: float = parameter(0.8, unit="rad", ge=0.05, le=3.0, description="yaw steps")


class _Tree(Parameters):
    control: ControlParameters = ControlParameters()
    behavior: _Limits = _Limits()


class StepVehicle:
    """Replacement for a ScriptedStation's vehicle: its status and its services.

    Attributes:
        zeta: damping of the response it flies; omega is the root of control.position.kp_xy.
        lose: (first, last) ticks that are missing in the log of the next test.
        lasts: whether a test continues until another behavior is requested.
        log_problem: reason why its log cannot be read.
    """

    def __init__(self, station: Any) -> None:
        self._station = station
        self._plain_call = station._call_blocking
        self._plain_put = station.put
        station.store = ParameterStore(_Tree().model_copy(deep=True))
        station._call_blocking = self._call
        self._began = time.monotonic()
        self.behavior, self.airborne = "hover", True
        self.zeta = 0.5
        self.lose: tuple[int, int] | None = None
        self.log_problem = ""
        self.ends_with, self.ends_after = "hover", math.inf
        self.log: tuple[np.ndarray, np.ndarray] = (np.zeros(0, np.int64), np.zeros((0, 0)))
        self._end_ns = 0
        self.lasts = False
        self._lock = threading.Lock()
        station.put = self._put

    def now_ns(self) -> int:
        return 1_780_000_000_000_000_000 + int(FASTER * 1e9 * (time.monotonic() - self._began))

    def _put(self, topic: str, message: Any) -> None:
        """Store a message in place of the station's method, with this vehicle's status."""
        if topic == "status":
            with self._lock:
                message = self._status()
        self._plain_put(topic, message)

    def _status(self) -> Any:
        now_ns = self.now_ns()
        if self.behavior == "excite" and now_ns >= self._end_ns and not self.lasts:
            self.behavior = self.ends_with
        flies = {"mode": "armed", "armed": True, "behavior": self.behavior}
        return new(
            "quadlab_msgs/VehicleStatus",
            header=header(now_ns),
            control_mode="direct",
            **{**flies, "airborne": self.airborne, **self._station.said},
            parameter_revision=self._station.store.revision,
            tick_rate=500.0,
            nominal_rate=500.0,
            lateness_p50=4.2e-5,
            lateness_p99=1.4e-4,
            lateness_max=6e-4,
            lateness_histogram=(912345, 8123, 712, 60, 5, 0, 0, 0),
        )

    def _call(self, service: str, request: Any) -> Any:
        if service == "onboard_log":
            return self._answer(request)
        reply = self._plain_call(service, request)
        if service == "start_behavior" and reply.accepted:
            with self._lock:
                if request.name == "excite":
                    self._excite(Plan(**dict[str, Any](from_parameters(request.arguments))))
                else:
                    self.behavior = request.name
        return reply

    def _excite(self, plan: Plan) -> None:
        """Compute the whole flight at once; the status shows it for its duration."""
        self.behavior = "excite"
        start_ns = self.now_ns() - 500_000_000
        seconds = 0.5 + LEAD + plan.edges * plan.duration
        flown = min(seconds, 0.5 + LEAD + self.ends_after)
        self._end_ns = start_ns + round(flown * 1e9)
        time_s = np.arange(0.0, flown + 1.0, STEP_NS * 1e-9)
        setpoint, actual = np.zeros_like(time_s), np.zeros_like(time_s)
        omega = math.sqrt(self._station.store.get("control.position.kp_xy"))
        level = 0.0
        for i, wanted in enumerate(list(LEVELS[plan.shape]) * plan.repeats):
            edge = 0.5 + LEAD + i * plan.duration
            if edge >= flown:
                break
            after, jump = time_s >= edge, wanted * plan.amplitude - level
            setpoint[after] += jump
            actual[after] += jump * _response(self.zeta, omega, time_s[after] - edge)
            level = wanted * plan.amplitude
        values = np.zeros((len(time_s), len(COLUMNS)))
        column = {name: j for j, name in enumerate(COLUMNS)}
        values[:, column["actuators.scaling"]] = 1.0
        values[:, column["actuators.motor_references.0"]] = 127.0 + 100.0 * np.abs(actual)
        half = 0.5 * actual if plan.axis == "yaw" else np.zeros_like(actual)
        values[:, column["state.pose.pose.orientation.2"]] = np.sin(half)
        values[:, column["state.pose.pose.orientation.3"]] = np.cos(half)
        if plan.axis == "yaw":
            values[:, column["reference.yaw"]] = setpoint
        else:
            i = AXES.index(plan.axis)
            values[:, column[f"state.pose.pose.position.{i}"]] = 1.0 + actual
            values[:, column[f"reference.position.{i}"]] = 1.0 + setpoint
        stamps = start_ns + STEP_NS * np.arange(len(time_s), dtype=np.int64)
        kept = np.ones(len(stamps), bool)
        if self.lose is not None:
            kept[self.lose[0] : self.lose[1] + 1] = False
            self.lose = None
        self.log = (stamps[kept], values[kept])

    def _answer(self, request: Any) -> Any:
        kind = f"{SERVICES['onboard_log']}_Response"
        self._station.requests.append(("onboard_log", request))
        if self.log_problem:
            return new(kind, accepted=False, reason=self.log_problem)
        stamps, values = self.log
        wanted = np.flatnonzero((stamps >= request.start_ns) & (stamps <= request.end_ns))
        sent = wanted[:ROWS]
        assert list(request.columns) == list(COLUMNS)
        return new(
            kind,
            accepted=True,
            file="quad1.mcap",
            stamps_ns=stamps[sent],
            values=values[sent].ravel(),
            complete=len(wanted) <= ROWS,
        )


def _response(zeta: float, omega: float, time_s: np.ndarray) -> np.ndarray:
    damped = omega * math.sqrt(1.0 - zeta**2)
    wave = np.cos(damped * time_s) + zeta / math.sqrt(1.0 - zeta**2) * np.sin(damped * time_s)
    return 1.0 - np.exp(-zeta * omega * time_s) * wave
