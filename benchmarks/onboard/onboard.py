"""The onboard step: filter, the 8 to its fourth derivative, eqs. 4 and 5, allocation."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.harness import Report, Row, Size, Target, time_in_turns
from benchmarks.onboard.compiled_step import onboard_step, onboard_steps
from benchmarks.peers.cpp_twin import NATIVE, PORTABLE, TUNED, CppTwin
from benchmarks.peers.rotorpy_flight import RotorPy
from control.controller import GeometricController
from control.parameters import ControlParameters
from control.trajectories.figure_eight import FigureEight
from estimation.complementary import ComplementaryEstimator
from estimation.parameters import EstimationParameters
from extensions.batches.batch import Scenario, fly_batch
from extensions.batches.onboard import new_onboard, new_settings
from quadrotor.records import (
    ACTUATORS,
    IMU_SAMPLE,
    POSE_SAMPLE,
    Array,
    Record,
    new_reference,
    new_state,
)
from quadrotor.rotations import rotate_inverse
from quadrotor.vehicle_model import GRAVITY, VehicleModel

PERIOD = 0.002
TWINS = {
    "C++ -O3": PORTABLE,
    "C++ -O3 -march=native": NATIVE,
    "C++ -O3 without errno and SLP": TUNED,
}


def run(size: Size = Size.FULL) -> Report:
    """Return rows of one onboard step each; accuracy is the largest difference of any thrust, N."""
    report = Report(
        "onboard",
        "Onboard step",
        [
            "one step: IMU sample → complementary filter's prediction → the 8 to its fourth "
            "derivative → eqs. 4 and 5 with feed-forward → allocation → motor references",
            "fed with the IMU samples of a recorded true-state flight of the 8, 500 Hz; "
            "the C++ twin (benchmarks/cpp) works on the same records by the same algorithms",
            "RotorPy: SE3Control.update alone, without filter, trajectory or feed-forward",
            "tick: the whole `FlightStack.tick` with plugins, behaviors, supervisor and mass "
            "estimate, flying the 8 in `SimulatedFlight`",
        ],
    )
    imu = recorded(size.of(2000, 500, 100))
    rounds = size.of(25, 5, 1)
    trajectory, model = FigureEight((0.0, 0.0, 1.0)), VehicleModel()
    settings = new_settings(trajectory, model, ControlParameters(), EstimationParameters())
    flown = started(imu)
    thrusts = {name: np.zeros((len(imu), 4)) for name in ("loop", *TWINS)}

    def loop() -> None:
        onboard_steps(started(imu, flown), settings, imu, thrusts["loop"], True, PERIOD)

    methods: dict[str, tuple[Callable[[], object], int]] = {"compiled loop": (loop, 1)}
    for name, flags in TWINS.items():
        try:
            twin = CppTwin(flags)
        except FileNotFoundError as error:
            report.notes.append(str(error))
            continue
        methods[name] = (_twin_loop(twin, flown, settings, imu, thrusts[name]), 1)
    one, single, t = started(imu), imu[:1].copy(), 0.5
    methods["compiled step called from Python"] = (
        lambda: onboard_step(one, settings, single, t, True, PERIOD),
        len(imu),
    )
    composed = Composed(trajectory, model)
    composed.initialize(flown)
    methods["Python composition of compiled parts"] = (lambda: composed.step(single, t), len(imu))
    try:
        methods["RotorPy SE3Control.update"] = (RotorPy().update, size.of(200, 20, 2))
    except ImportError as error:
        report.notes.append(f"RotorPy left out: {error}")

    timings = time_in_turns(methods, rounds)
    loops = ("compiled loop", *TWINS)
    for name, timing in timings.items():
        per = len(imu) if name in loops else 1
        figures: dict[str, float | str] = {
            "µs a step": 1e6 * timing.median / per,
            "fastest": 1e6 * timing.spread[0] / per,
            "slowest": 1e6 * timing.spread[1] / per,
        }
        if name in TWINS:
            figures["difference, N"] = float(np.abs(thrusts[name] - thrusts["loop"]).max())
        report.rows.append(Row(name, figures))
    ours = timings["compiled loop"]
    if "C++ -O3" in timings:
        ratio = ours.over(timings["C++ -O3"])
        report.targets.append(Target("compiled loop over C++ -O3", ratio, 1.1))
        worst = max(float(np.abs(thrusts[n] - thrusts["loop"]).max()) for n in TWINS)
        report.targets.append(Target("largest difference to C++, N", worst, 1e-9))
    if "RotorPy SE3Control.update" in timings:
        ratio = timings["RotorPy SE3Control.update"].over(ours) * len(imu)
        report.targets.append(
            Target("times as fast as SE3Control.update alone", ratio, 180.0, at_most=False)
        )
    _tick(report, size.of(20.0, 4.0, 0.5))
    bars = {row.method: row.figures["µs a step"] for row in report.rows}
    report.plot = {
        "kind": "figures",
        "labels": list(bars),
        "values": list(bars.values()),
        "x_label": "µs a step",
    }
    return report


def recorded(count: int) -> Record:
    """Return the ideal IMU samples (count,) of a true-state flight of the 8."""
    flight = fly_batch(
        [Scenario(true_state=True, whole_references=False)], count * PERIOD, history_rate=500.0
    )
    assert flight.history is not None
    truth = flight.history["truth"][0]
    imu = np.zeros(count, IMU_SAMPLE)
    imu["stamp_ns"] = np.arange(1, count + 1) * round(1e9 * PERIOD)
    imu["angular_velocity_b"] = truth[:, 10:13]
    felt = np.gradient(truth[:, 3:6], PERIOD, axis=0)
    felt[:, 2] += GRAVITY
    for k in range(count):
        imu["specific_force_b"][k] = rotate_inverse(truth[k, 6:10].copy(), felt[k])
    return imu


def started(imu: Record, like: Record | None = None) -> Record:
    """Return an ONBOARD record at the 8's beginning, or a copy of one."""
    if like is not None:
        return like.copy()
    onboard = new_onboard()
    onboard["estimator"]["initialized"] = 1
    onboard["estimator"]["pose"][0, 2] = 1.0
    return onboard


def _twin_loop(
    twin: CppTwin, flown: Record, settings: Record, imu: Record, thrusts: Array
) -> Callable[[], object]:
    return lambda: twin.steps(started(imu, flown), settings, imu, thrusts, PERIOD)


class Composed:
    """The same step composed in Python: the plugins' calls one after another."""

    def __init__(self, trajectory: FigureEight, model: VehicleModel) -> None:
        self.estimator, self.controller = ComplementaryEstimator(), GeometricController()
        self.controller.configure(ControlParameters(), model.record())
        self.trajectory = trajectory
        self.state, self.reference = new_state(), new_reference()
        self.actuators = np.zeros(1, ACTUATORS)

    def initialize(self, onboard: Record) -> None:
        pose = np.zeros(1, POSE_SAMPLE)
        pose["position_w"] = onboard["estimator"]["pose"][:, :3]
        pose["quaternion_wb"] = onboard["estimator"]["pose"][:, 3:]
        self.estimator.initialize(pose)

    def step(self, imu: Record, t: float) -> None:
        self.estimator.predict(imu, PERIOD, self.state)
        self.trajectory.sample(t, self.reference)
        self.controller.step(self.state, self.reference, True, PERIOD, self.actuators)


def _tick(report: Report, seconds: float) -> None:
    """Measure the vehicle's own tick, median and 99.9th percentile.

    The target is for processor time: another process that occupies the core is not the tick's work,
    and on the vehicle real-time priority prevents it.
    """
    wall, busy = 1e-3 * np.array(ticks(seconds)).T
    median, late = float(np.median(wall)), float(np.percentile(busy, 99.9))
    figures: dict[str, float | str] = {
        "µs a step": median,
        "99.9 %": float(np.percentile(wall, 99.9)),
        "99.9 % of processor time": late,
    }
    report.rows.append(Row("whole Python tick with plugins", figures))
    report.targets.append(Target("median of the whole Python tick, µs", median, 20.0))
    report.targets.append(
        Target("99.9th percentile of the whole Python tick, µs of processor time", late, 100.0)
    )


def ticks(seconds: float) -> list[tuple[int, int]]:
    """Return the ns of each tick, wall and processor time, over `seconds` of a simulated 8."""
    from quadlab.simulated.flight import SimulatedFlight
    from quadlab.simulated.parameters import FlightParameters
    from vehicle.realtime import freeze_garbage
    from vehicle.simulator.simulated_vehicle import SimulatedVehicle

    parameters = FlightParameters()
    nothing: Any = _Nothing()
    flight = SimulatedFlight(parameters, SimulatedVehicle(parameters.simulator), nothing)
    flight.wait_until(lambda view: view.mode == "ready", what="the gyroscope", timeout=5.0)
    flight.wait(0.3)
    flight.arm()
    flight.wait(1.0)
    flight.start("take_off")
    flight.wait(6.0)
    flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
    flight.wait(2.0)
    stack: Any = flight.stack
    tick, found = stack.tick, []

    def timed(sample: object) -> object:
        busy = time.thread_time_ns()
        began = time.perf_counter_ns()
        out = tick(sample)
        took = time.perf_counter_ns() - began
        found.append((took, time.thread_time_ns() - busy))
        return out

    stack.tick = timed
    freeze_garbage()  # as in the vehicle's process
    flight.wait(seconds)
    gc.enable()
    gc.unfreeze()
    return found


class _Nothing:
    """A flight log that stores nothing."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *arguments: None
