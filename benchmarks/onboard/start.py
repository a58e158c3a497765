"""Time to the first step: from a fresh interpreter, with cached compiled code and without."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

from benchmarks.harness import Report, Row, Size, Target, Timing
from quadrotor.checkout import ROOT

FLIGHT = """
import time; began = time.perf_counter()
import vehicle.flight.kernels as k
_, later = k.prepare(say=lambda line: None)
ready = time.perf_counter() - began
later.wait()
print(ready, time.perf_counter() - began)
"""
STEP = """
import time; began = time.perf_counter()
import numpy as np
from control.controller import GeometricController
from control.parameters import ControlParameters
from control.trajectories.figure_eight import FigureEight
from estimation.complementary import ComplementaryEstimator
from quadrotor.records import ACTUATORS, IMU_SAMPLE, POSE_SAMPLE, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel
controller, estimator = GeometricController(), ComplementaryEstimator()
controller.configure(ControlParameters(), VehicleModel().record())
state, reference, actuators = new_state(), new_reference(), np.zeros(1, ACTUATORS)
pose, imu = np.zeros(1, POSE_SAMPLE), np.zeros(1, IMU_SAMPLE)
pose["quaternion_wb"][0, 0], imu["specific_force_b"][0, 2], imu["stamp_ns"] = 1.0, 9.81, 2_000_000
estimator.initialize(pose)
estimator.predict(imu, 0.002, state)
FigureEight((0.0, 0.0, 1.0)).sample(0.0, reference)
controller.step(state, reference, True, 0.002, actuators)
print(time.perf_counter() - began)
"""


def run(size: Size = Size.FULL) -> Report:
    """Start both programs, cold and from the cache, each in a separate interpreter."""
    rounds = size.of(5, 2, 1)
    report = Report(
        "start",
        "Start: import, compile, first step",
        [
            "each figure is one fresh interpreter, timed from its first line",
            "first step: estimate, figure 8, control, allocation called once from Python",
            "flight ready: everything the vehicle's tick calls with its default estimator and law, "
            "compiled or loaded and called once; two processes compile",
            "every kernel: also bearing poses, error-state filter and near-hovering law, which "
            "compile in the background at idle priority",
            f"cold: an empty folder of compiled code; {rounds} rounds each",
        ],
    )
    step, ready, every = "first step", "flight ready", "every kernel"
    cold: dict[str, Timing] = {}
    warm: dict[str, Timing] = {}
    for names, program in (((step,), STEP), ((ready, every), FLIGHT)):
        with tempfile.TemporaryDirectory() as folder:
            # To compile takes up to half a minute: a smoke run has what is compiled already.
            has_all = size is Size.SMOKE
            caches = [None if has_all else f"{folder}/{k}" for k in range(rounds)]
            first = [_once(program, cache) for cache in caches]
            again = [_once(program, caches[0]) for _ in range(size.of(2 * rounds, 2 * rounds, 1))]
        for k, name in enumerate(names):
            cold[name] = Timing(tuple(run[k] for run in first))
            warm[name] = Timing(tuple(run[k] for run in again))
    for name, without in cold.items():
        figures: dict[str, float | str] = {}
        for label, timing in (("cold", without), ("from cache", warm[name])):
            low, high = timing.spread
            figures[f"{label}, s"] = round(timing.median, 2)
            figures[f"{label}, range"] = f"{low:.2f}–{high:.2f}"
        report.rows.append(Row(name, figures))
    report.targets = [
        Target(f"{step}, from cache, s", warm[step].median, 0.8),
        Target(f"{ready}, cold, s", cold[ready].median, 5.0),
        Target(f"{every}, cold, s", cold[every].median, 5.0),
    ]
    return report


def _once(program: str, cache: str | None) -> tuple[float, ...]:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPATH": str(ROOT)} | ({"NUMBA_CACHE_DIR": cache} if cache else {})
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    return tuple(map(float, done.stdout.split()))
