"""Compile every function of the tick before the first sample is used.

Compiling takes seconds on one core, so on a machine without cached code (the first start, or after
a change) a second process compiles some of the parts, and each finished part is logged. Cached code
loads at once. The warm-up hop comes last: after it, everything the tick may call has been called
once.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial

from quadrotor.compiled import is_cached
from quadrotor.errors import JobError
from vehicle_link.jobs import IDLE, Job


def _controller() -> None:
    from control.controller import GeometricController
    from control.disturbance_observer import DisturbanceObserver
    from control.parameters import ControlParameters, DisturbanceParameters
    from quadrotor.vehicle_model import VehicleModel

    GeometricController().configure(ControlParameters(), VehicleModel().record())
    DisturbanceObserver(DisturbanceParameters())


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
    from estimation.poses.planar_pose import PlanarPoseSolver

    PlanarPoseSolver(PAPER_BEACONS.positions_w)


def _on_bearings(estimator: str) -> None:
    from estimation.registry import prepare

    prepare(estimator, True)


def _near_hovering() -> None:
    from control.near_hovering import NearHoveringController
    from control.parameters import ControlParameters
    from quadrotor.vehicle_model import VehicleModel

    NearHoveringController().configure(ControlParameters(), VehicleModel().record())


Parts = dict[str, tuple[str, Callable[[], None]]]

PARTS: Parts = {
    "controller": ("control.geometric_law", _controller),
    "estimator": ("estimation.complementary_filter", _estimator),
    "behaviors": ("control.trajectories.phase_curve", _behaviors),
}
"""Parts that the tick needs: part -> (module whose cached code shows that it is compiled,
compiler)."""
LATER: Parts = {
    "bearing poses": ("estimation.poses.frame_solution", _bearings),
    "bearings in the complementary filter": (
        "estimation.poses.position_at_attitude",
        partial(_on_bearings, "complementary"),
    ),
    "error-state filter": ("estimation.error_state.filter", partial(_on_bearings, "error_state")),
    "near-hovering law": ("control.near_hovering", _near_hovering),
}
"""Parts that only comms or the choice of another estimator or law needs: compiled in the background
at idle priority."""
IN_SECOND_PROCESS = "controller"
"""Part that the second process compiles; the rest takes about the same time."""


class BackgroundParts:
    """The parts of LATER, loaded at once when cached. Otherwise they are compiled in the background
    and loaded once that is done and the motors are off.

    An estimator can then be chosen in flight.
    """

    def __init__(self) -> None:
        self._cached = [part for part, (module, _) in LATER.items() if is_cached(module)]
        self._missing = [part for part in LATER if part not in self._cached]
        self._process = Job(compile_parts, self._missing, niceness=IDLE) if self._missing else None

    @property
    def has_compiled(self) -> bool:
        """Return whether the background compilation has ended and was not loaded yet."""
        return self._process is not None and self._process.poll()

    def load(self) -> list[str]:
        """Load the cached code, in some 0.1 s; return the parts.

        A part that failed to compile in the background is compiled when it is chosen, on the
        ground.
        """
        parts, self._cached = self._cached, []
        if self.has_compiled:
            parts += [part for part in self._missing if is_cached(LATER[part][0])]
            self._process = None
        for part in parts:
            LATER[part][1]()
        return parts

    def wait(self) -> None:
        """Wait until the background compilation has ended."""
        while self._process is not None and not self._process.poll(1.0):
            pass

    def close(self) -> None:
        if self._process is not None:
            self._process.stop()


def prepare(say: Callable[[str], None]) -> tuple[list[str], BackgroundParts]:
    """Compile the missing parts, load the others, and fly the warm-up hop.

    Call it before asking for real-time priority, which a child process would inherit.

    Args:
        say: called with a line when something has to be compiled, and one for each part.

    Returns what was refused in the hop (what follows it would compile in flight), and the parts
    compiled in the background, which the caller closes at the end.
    """
    later = BackgroundParts()
    missing = [part for part, (module, _) in PARTS.items() if not is_cached(module)]
    if missing:
        with _without_garbage_collection():
            _compile(missing, say)
    from vehicle.flight.warm_up import warm_up

    refused = warm_up()
    later.load()
    return refused, later


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Switch the garbage collector off: a compiler makes few cycles and many objects, and scanning
    them takes 7 % of its time.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _compile(missing: list[str], say: Callable[[str], None]) -> None:
    say(f"compiling the flight laws, once, which takes some seconds: {', '.join(missing)}")
    helper = None
    if IN_SECOND_PROCESS in missing and len(missing) > 1 and (os.cpu_count() or 1) > 1:
        helper = Job(compile_parts, [IN_SECOND_PROCESS], niceness=0)
    for part in missing:
        if helper is None or part != IN_SECOND_PROCESS:
            PARTS[part][1]()
            say(f"{part} compiled")
    if helper is not None:
        with suppress(JobError):  # the hop compiles it
            helper.result()
            say(f"{IN_SECOND_PROCESS} compiled")


def compile_parts(names: list[str]) -> None:
    """Compile the named parts in a separate process."""
    with _without_garbage_collection():
        for name in names:
            (PARTS | LATER)[name][1]()
