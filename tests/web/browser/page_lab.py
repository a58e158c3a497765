"""Laboratory for tests of pages: two runs, a history of gains, an account, a flying vehicle.

The vehicle flies a circle without end. `flying_lab` is used through conftest's fixture `helper`.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bearing_sim.emulator import BearingParameters
from bearing_sim.tracker import TrackerParameters
from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.catalogue.notes import write_notes
from console.catalogue.tags import change_tags
from console.parameters.history import ParameterHistory, RecordedChange
from console.runs.adoption import tidy_runs
from control.behaviors.parameters import BehaviorParameters
from control.parameters import ControlParameters
from estimation.parameters import EstimationParameters
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.vehicle_model import VehicleModel
from tests.web.conftest import Compared
from vehicle.boards.imu import ImuCalibration
from vehicle.safety.parameters import SafetyParameters
from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import header, new
from web.access.accounts import Accounts
from web.access.database import AccessDatabase
from web.access.passwords import Passwords
from web.access.roles import Role
from web.latest import TICKS

RUN, LATER = "20260131T093042Z_quad1", "20260131T100000Z_quad1"
NAME, PASSWORD = "anna", "correct horse battery"
PERIOD = 0.1  # s, between two samples
CHANGES = (
    ("control.position.kp_xy", 4.0, 4.4),
    ("control.position.kp_z", 8.0, 8.6),
    ("control.position.kp_xy", 4.4, 4.8),
)
FOUND = [
    Check("link", "ok", "good", "good"),
    Check("clock", "warn", "not synchronised", "synchronised", "start chrony", "vehicle"),
    Check("real-time rights", "fail", "refused", "SCHED_FIFO 50", "write limits.d", "vehicle"),
]


class _Station(Parameters):
    bearings: BearingParameters = BearingParameters()
    comparison: Compared = Compared()
    tracker: TrackerParameters = TrackerParameters()


class _Root(Parameters):
    imu: ImuCalibration = ImuCalibration()
    model: VehicleModel = VehicleModel()
    control: ControlParameters = ControlParameters()
    behavior: BehaviorParameters = BehaviorParameters()
    estimation: EstimationParameters = EstimationParameters()
    safety: SafetyParameters = SafetyParameters()
    station: _Station = _Station()


def circle(station: Any, t: float, *, stands: bool = False) -> None:
    """Publish a sample of a vehicle that flies a circle under anna's control, or rests; t in s."""
    stamp, angle, lag = header(time.time_ns()), 0.0 if stands else 0.8 * t, 0.06
    wobble = 0.0 if stands else 0.012 * math.sin(3.1 * t)
    speed = 0.0 if stands else 0.96

    def place(a: float) -> tuple[float, float, float]:
        if stands:
            return (0.0, 0.0, 0.06)
        return (1.2 * math.cos(a), 1.2 * math.sin(a), 1.2 + 0.15 * math.sin(0.5 * a))

    x, y, z = place(angle - lag)
    half = 0.0 if stands else 0.5 * 0.12
    truth = {"pose": {"position": (x, y + 0.004, z), "orientation": (half, half, 0.0, 0.995)}}
    twist = {
        "twist": {
            "linear": (-speed * math.sin(angle), speed * math.cos(angle), wobble),
            "angular": (wobble, 0.4 * wobble, 0.1 * speed),
        }
    }
    put = station.put
    ours = (TICKS, "truth", "link_status", "station_status")
    station.put = lambda topic, message: None if topic in ours else put(topic, message)
    station.fly()
    station.put = put
    tick = station.tick(x + wobble, y, z)
    state = tick["state"]
    state["quaternion_wb"] = (0.995, half, half, 0.0)
    state["velocity_w"], state["angular_velocity_b"] = twist["twist"].values()
    tick["reference"]["position_w"] = place(angle)
    put(TICKS, tick)
    put("truth", new("nav_msgs/Odometry", header=stamp, pose=truth, twist=twist))
    put(
        "link_status",
        new(
            "quadlab_msgs/LinkStatus",
            header=stamp,
            state="good",
            age=0.006 + 0.2 * abs(wobble),
            round_trip=0.004 + 0.1 * abs(wobble),
            jitter=0.0007 + 0.02 * abs(wobble),
            clock_offset=0.0002 + 0.003 * wobble,
            telemetry_rate=100.0,
            state_duration=t % 3600.0,
        ),
    )
    put(
        "station_status",
        new(
            "quadlab_msgs/StationStatus",
            header=stamp,
            tracker_rate=100.0,
            recording=True,
            recording_duration=t % 3600.0,
            recording_bytes=round(2.5e5 * (t % 3600.0)),
            run_id=LATER,
        ),
    )
    put(
        "preflight",
        new(
            "quadlab_msgs/Preflight",
            header=stamp,
            ready=True,
            armed=True,
            blocks=True,
            checks=to_messages(FOUND[:1]),
        ),
    )
    station.control(NAME)


def _furnish(data: Path, catalogue: Catalogue) -> None:
    made = MadeRun(16.0, silence=(9.0, 9.5), marks=[(7.0, "gust")])
    write_run(data / "runs" / f"{RUN}.mcap", made)
    write_run(data / "runs" / f"{LATER}.mcap", MadeRun(16.0, late=1.0), seed=2)
    tidy_runs(catalogue)
    change_tags(catalogue, [RUN], ["figure 8", "wind"], [])
    write_notes(catalogue, RUN, "Gust from the door at 7 s; held.", NAME)
    Accounts(AccessDatabase(data / "web"), Passwords(1, 8)).add(NAME, Role.ADMIN, PASSWORD)
    history, began_ns = ParameterHistory(catalogue.engine, "quad1"), time.time_ns() - 60 * 10**9
    history.begin_flight("run9", began_ns)
    for k, (name, old, value) in enumerate(CHANGES):
        at_ns = began_ns + 15 * 10**9 * k
        history.add([RecordedChange(name, old, value, NAME, at_ns, k, "run9", at_ns)])


@contextmanager
def flying_lab(data: Path, serve: Any, step_vehicle: Any, calibrating: Any) -> Iterator[Any]:
    """Yield a site; `site.vehicle` flies its step tests. Estimators are compared at 5 Hz.

    `site.experiment`: fields of an ExperimentStatus; with them the vehicle is on the ground.
    """
    catalogue = Catalogue(data)
    _furnish(data, catalogue)
    with serve(data, catalogue) as site:
        ended = threading.Event()
        site.vehicle = step_vehicle.StepVehicle(site.station)
        site.station.store = ParameterStore(_Root().model_copy(deep=True))
        site.calibrating, site.experiment, kept = calibrating, None, calibrating.history()
        answer = site.station._call_blocking

        def call(service: str, request: Any) -> Any:
            response = calibrating.answered(service, request, answer(service, request), kept)
            if service == "checks":
                response.checked, response.checks = time.time(), to_messages(FOUND)
            return response

        def fly() -> None:
            compare_at = 0.0
            while not ended.wait(PERIOD):
                t = time.monotonic()
                told = site.experiment
                site.station.said = dict(calibrating.Bench.GROUND) if told else {}
                circle(site.station, t, stands=bool(told))
                if told:
                    status = new("quadlab_msgs/ExperimentStatus", **told)
                    site.station.put("experiment_status", status)
                if t > compare_at:
                    compare_at = t + 0.2
                    site.station.compare(("vehicle", "error_state"))

        site.station._call_blocking = call
        thread = threading.Thread(target=fly, daemon=True)
        thread.start()
        yield site
        ended.set()
        thread.join()
    catalogue.close()
