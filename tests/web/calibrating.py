"""Station whose vehicle is calibrated, for tests of the page: its reports, step by step.

It is used through conftest's fixture `helper`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from quadrotor.calibration_record import CalibrationRecord, Quality, parse_record
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, ParameterStore, parameter
from quadrotor.vehicle_model import VehicleModel
from vehicle.boards.imu import ImuCalibration
from vehicle_link.messages import new
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import to_descriptor

RUN = "20260131T093042Z_quad1"
EARLIER = "20260101T080000Z_quad1"
SILENT = "the vehicle has not told its calibrations yet"
DAY_NS = 86_400 * 10**9
PROPOSES = {
    "gyroscope": "gyroscope",
    "accelerometer": "accelerometer",
    "motor_bench": "motor",
    "mass": "mass",
    "inertia": "inertia",
}
NAMES = ("bearings", *PROPOSES, "my_hops", "my_slip.py")
ABOUT = {
    "bearings": "Flies on bearings alone and back.",
    "gyroscope": "Measures the gyroscope's bias at rest, then checks what is left.",
    "accelerometer": "Matrix and bias of the accelerometer from poses held still.",
    "motor_bench": "Law of motor and propeller, torque ratio and time constant on a force sensor.",
    "mass": "Take-off on a low estimate, hover until it has converged, erratic flight, landing.",
    "inertia": "Inertia about three axes from an excitation in flight.",
    "my_hops": "Three hops of half a metre.",
}
BROKEN = "my_slip.py line 12: invalid syntax; docs/experiments.md shows one"


class _Options(Parameters):
    method: str = parameter("tracker", choices=("tracker", "faces"), description="where up is")
    poses: int = parameter(12, ge=4, le=40, description="poses to be held")
    hold: float = parameter(1.0, unit="s", ge=0.3, le=10.0, description="of holding still")


class _Root(Parameters):
    model: VehicleModel = VehicleModel()
    imu: ImuCalibration = ImuCalibration()


def _record(name: str, days: float, **fields: Any) -> CalibrationRecord:
    stamp_ns = time.time_ns() - round(days * DAY_NS)
    return CalibrationRecord(
        name=name, stamp_ns=stamp_ns, requester="anna", run_id=EARLIER, **fields
    )


def accelerometer(bias: float = 0.031, worst: float = 0.021) -> CalibrationRecord:
    """Return a proposal from twelve poses."""
    values: dict[str, ParameterValue] = {
        "imu.accelerometer_xx": 1.0042,
        "imu.accelerometer_yy": 0.9971,
        "imu.accelerometer_zz": 1.0015,
        "imu.accelerometer_xy": 0.0021,
        "imu.accelerometer_bias_x": bias,
        "imu.accelerometer_bias_y": -0.12,
        "imu.accelerometer_bias_z": 0.2,
    }
    return CalibrationRecord(
        name="accelerometer",
        values=values,
        quality=(
            Quality(name="residual, rms", value=0.018, unit="m/s²", limit=0.05),
            Quality(name="worst residual", value=worst, unit="m/s²", limit=0.1),
            Quality(name="condition number", value=6.2, limit=120.0),
        ),
        residuals=tuple((f"pose {k + 1}, m/s²", abs(worst * math.cos(2.3 * k))) for k in range(12)),
        conditions={"attitude": "tracker", "rate": "500 Hz", "poses": "12", "simulated": "yes"},
    )


def motor() -> CalibrationRecord:
    """Return a proposal from seventeen steps, the time constant from force alone."""
    values: dict[str, ParameterValue] = {
        "model.motor_slope": 0.0126611,
        "model.motor_offset": 14.131,
        "model.torque_ratio": 0.01738,
        "model.motor_time_constant": 0.0473,
    }
    return CalibrationRecord(
        name="motor",
        values=values,
        figures=(Quality(name="worst of the quadratic", value=3.1, unit="count"),),
        quality=(
            Quality(name="worst of the root law", value=0.14, unit="count", limit=0.5),
            Quality(name="torque residual", value=0.0021, unit="N m", limit=0.002),
        ),
        residuals=tuple(
            (f"step {30 + 10 * k}, count", 0.14 * math.sin(1.9 * k)) for k in range(16)
        ),
        warnings=("the time constant is found from force alone; measure the speed to be sure",),
        conditions={"sensor": "simulated Nano17", "battery": "15.2 V"},
    )


def history() -> list[CalibrationRecord]:
    """Return the calibrations that the vehicle stores, newest first."""
    still = (Quality(name="standard error", value=0.006, unit="°/s", limit=0.03),)
    drift = tuple(
        Quality(name=f"drift {axis}", value=value, unit="°/s")
        for axis, value in (("x", 0.41), ("y", -0.22), ("z", 0.07))
    )
    hovered = (Quality(name="deviation", value=0.0021, unit="kg", limit=0.004),)
    held = accelerometer(0.05)
    return [
        _record("gyroscope", 0.02, quality=still, figures=drift).model_copy(
            update={"requester": "start", "run_id": ""}
        ),
        _record(
            "mass", 2.0, quality=hovered, values={"model.mass": 1.308}, previous={"model.mass": 1.2}
        ),
        _record(
            "accelerometer",
            9.0,
            values=held.values,
            previous=dict.fromkeys(held.values, 0.0),
            quality=held.quality,
            residuals=held.residuals,
            conditions=held.conditions,
        ),
    ]


def pose_figures(count: int) -> dict[str, tuple[float, str]]:
    """Return the figures of `count` poses within 70 deg, and of the next one."""
    figures: dict[str, tuple[float, str]] = {}
    for k in range(count + 1):
        tilt, turn = math.radians(15 + 55 * ((5 * k) % 12) / 12), 2.4 * k
        up = (math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), math.cos(tilt))
        place = f"pose {k + 1}" if k < count else "next"
        figures.update(
            {f"{place} {axis}": (value, "") for axis, value in zip("xyz", up, strict=True)}
        )
    return figures


def told(
    name: str, live: dict[str, tuple[float, str]] | None = None, **fields: Any
) -> dict[str, Any]:
    """Return the fields of an ExperimentStatus during a calibration."""
    live = live or {}
    return {
        "name": name,
        "phase": "flying",
        "requester": "anna",
        "elapsed": 24.0,
        "planned": 90.0,
        "live_names": list(live),
        "live_values": [value for value, _ in live.values()],
        "live_units": [unit for _, unit in live.values()],
        **fields,
    }


def ended(name: str, record: CalibrationRecord | None, **fields: Any) -> dict[str, Any]:
    """Return the fields of an ExperimentStatus after it."""
    return {
        "name": name,
        "phase": "passed",
        "verdict": "passed",
        "requester": "anna",
        "run_id": RUN,
        "elapsed": 93.0,
        "planned": 90.0,
        "proposal": record.model_dump_json() if record else "",
        **fields,
    }


def answered(service: str, request: Any, answer: Any, kept: list[CalibrationRecord]) -> Any:
    """Return a station's answer with its experiments, and with its vehicle's calibrations."""
    if not answer.accepted:
        return answer
    if service == "calibrate":
        answer.records = [record.model_dump_json() for record in kept]
    if service == "experiment" and request.action == "describe":
        answer.names = list(NAMES)
        answer.descriptions = [ABOUT.get(name, "") for name in NAMES]
        answer.calibrations = [PROPOSES.get(name, "") for name in NAMES]
        answer.problems = [BROKEN if name == "my_slip.py" else "" for name in NAMES]
        answer.descriptors = [
            to_descriptor(replace(one, name=f"accelerometer.{one.name}"))
            for one in ParameterStore(_Options()).descriptions()
        ]
    return answer


class Bench:
    """Makes a ScriptedStation calibrate; `status` is what it publishes, None for nothing."""

    GROUND = {"mode": "ready", "behavior": "ground", "armed": False, "airborne": False, "flags": []}  # noqa: RUF012

    def __init__(self, station: Any) -> None:
        self.station = station
        station.store = ParameterStore(_Root().model_copy(deep=True))
        self._defaults = station.store.values()
        self.begin()
        self._fly, self._call = station.fly, station._call_blocking
        station.fly, station._call_blocking = self.fly, self.call

    def begin(self) -> None:
        """Reset to the initial state, on the ground, without requests."""
        self.kept = history()
        self.told_history = True
        self.status: dict[str, Any] | None = {"phase": "idle"}
        self.station.said = dict(self.GROUND)
        self.station.requests.clear()
        self._set(self._defaults, "anna")

    def _set(self, values: Mapping[str, Any], requester: str) -> None:
        """Set values, and publish them to the page like any change."""
        store = self.station.store
        changed = {name: value for name, value in values.items() if store.get(name) != value}
        store.set(changed)
        for name, value in changed.items():
            change = ParameterChange(0, name, value, value, requester, store.revision, 0)
            self.station.reactions.changed(change)

    def fly(self) -> None:
        self.station.specific_force = (1.4, 2.1, 9.4)
        self._fly()
        if self.status is not None:
            message = new("quadlab_msgs/ExperimentStatus", **self.status)
            self.station.put("experiment_status", message)

    def falls_silent(self) -> None:
        """Let the experiment's status become old."""
        self.status = None
        self.station._live._newest["experiment_status"].received -= 60.0

    def call(self, service: str, request: Any) -> Any:
        if service == "calibrate" and not self.told_history:
            return new("quadlab_msgs/srv/Calibrate_Response", reason=SILENT)
        answer = answered(service, request, self._call(service, request), self.kept)
        if not answer.accepted:
            return answer
        if service == "experiment" and request.action in ("accept", "reject") and self.status:
            self.status = {**self.status, "decision": f"{request.action}ed"}
            if request.action == "accept":
                self._keep(request.requester)
        return answer

    def _keep(self, requester: str) -> None:
        assert self.status is not None
        record = parse_record(self.status["proposal"])
        before = {name: self.station.store.get(name) for name in record.values}
        self._set(record.values, requester)
        update = {
            "stamp_ns": time.time_ns(),
            "requester": requester,
            "previous": before,
            "run_id": self.status["run_id"],
        }
        self.kept.insert(0, record.model_copy(update=update))
