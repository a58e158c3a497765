"""Every compiled function of the tick, ready before the first sample counts.

Compiling takes seconds and only one core, so on a machine without kept code (the first start, or
after a change) a second process takes half of it, and each part done is told. What is kept
already is loaded in a moment. The warm-up hop has the last word: whatever the tick may call has
then been called once.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from quadrotor.compiled import kept

REPOSITORY = Path(__file__).resolve().parent.parent


def _controller() -> None:
    from control.controller import GeometricController
    from control.parameters import ControlParameters
    from quadrotor.vehicle_model import VehicleModel

    GeometricController().configure(ControlParameters(), VehicleModel().record())


def _estimator() -> None:
    import numpy as np

    from estimation.complementary import ComplementaryEstimator
    from quadrotor.records import ESTIMATE, IMU_SAMPLE, POSE_SAMPLE, new_state

    estimator, state = ComplementaryEstimator(), new_state()
    pose, imu, estimate = (np.zeros(1, kind) for kind in (POSE_SAMPLE, IMU_SAMPLE, ESTIMATE))
    pose["quaternion_wb"][:, 0] = 1.0
    estimator.initialize(pose)
    for stamp_ns in (2_000_000, 4_000_000):
        imu["stamp_ns"] = pose["stamp_ns"] = stamp_ns
        estimator.predict(imu, 0.002, state)
        estimator.correct(pose, estimate)
        estimator.report(estimate)


def _behaviors() -> None:
    from control.behaviors.machine import BehaviorMachine
    from control.behaviors.parameters import BehaviorParameters

    BehaviorMachine(BehaviorParameters())


def _bearings() -> None:
    from bearing_sim.beacons import PAPER_BEACONS
    from estimation.planar_pose import PlanarPoseSolver

    PlanarPoseSolver(PAPER_BEACONS.positions_w)


PARTS: dict[str, tuple[str, Callable[[], None]]] = {
    "controller": ("control.controller", _controller),
    "estimator": ("estimation.complementary_filter", _estimator),
    "behaviors": ("control.trajectories.phase_curve", _behaviors),
    "bearing poses": ("estimation.frame_solution", _bearings),
}
"""Part -> a module whose kept code tells that the part is compiled, and how to compile it."""
HELPED = ("controller", "bearing poses")
"""What the second process takes; the halves take about the same time."""


def prepare(say: Callable[[str], None]) -> list[str]:
    """Compile what is missing, load the rest, fly the hop.

    Args:
        say: gets a line when something is compiled, and one a part.

    Returns what was refused in the hop: what comes after it would compile in flight.
    """
    missing = [part for part, (module, _) in PARTS.items() if not kept(module)]
    if missing:
        _compile(missing, say)
    from vehicle.flight_warm_up import warm_up

    return warm_up()


def _compile(missing: list[str], say: Callable[[str], None]) -> None:
    with _without_garbage_collection():
        _compile_parts(missing, say)


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """A compiler makes few cycles and many objects: looking through them takes 7 % of its time."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _compile_parts(missing: list[str], say: Callable[[str], None]) -> None:
    helped = [part for part in missing if part in HELPED and (os.cpu_count() or 1) > 1]
    say(f"compiling the flight laws, once, which takes some seconds: {', '.join(missing)}")
    helper = None
    if helped and len(missing) > 1:
        helper = subprocess.Popen([sys.executable, "-m", __name__, *helped], cwd=REPOSITORY)
    for part in missing:
        if helper is None or part not in helped:
            PARTS[part][1]()
            say(f"{part} compiled")
    if helper is not None and helper.wait() == 0:
        say(f"{', '.join(helped)} compiled")


if __name__ == "__main__":
    with _without_garbage_collection():
        for name in sys.argv[1:]:
            PARTS[name][1]()
