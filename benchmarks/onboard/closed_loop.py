"""The closed loop: steps of 1 ms of plant with their share of sensors, filter and controller."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.peers.compiled_twin import fly_true_state
from benchmarks.peers.cpp_twin import NATIVE, PORTABLE, CppTwin
from benchmarks.peers.crazyflow_flight import WORLDS, Crazyflow
from extensions.batches.batch import Scenario, fly_batch, prepare
from extensions.batches.onboard import new_onboard
from quadrotor.records import Record

SECONDS = 27.0
HOVER = 8.0
"""Time, in s, before the 8 with sensors, in which the filter's biases settle."""
TRUE, FULL = "compiled, true state", "compiled, sensors and filter"
ALIKE = "compiled, the work of the C++ twin alone"
CPP = "C++ -O3, true state"
TWINS = {CPP: PORTABLE, "C++ -O3 -march=native, true state": NATIVE}
ROTORPY = "RotorPy Environment"

Method = Callable[[], tuple[float, float | None, float | None]]
"""Function that flies and returns the number of steps of 1 ms, the rms position error in m or None,
and the seconds of processor time if spent in another process."""


def run(size: Size = Size.FULL) -> Report:
    """Return rows of steps per second of wall time and of processor time, all threads together."""
    report = Report(
        "closed_loop",
        "Closed-loop simulation",
        [
            "one step: 1 ms of plant (four rotors, rigid body by classical Runge-Kutta, drag, "
            "ground) with its half of a 500 Hz control period, flying the 8",
            "true state: reference, eqs. 4 and 5, allocation, plant, error statistics; "
            "sensors and filter: also counted noisy IMU at 500 Hz, 100 Hz tracker with "
            "corrections, complementary filter, whole motor references",
            "RotorPy: Multirotor and SE3Control in its own Environment at 1 kHz, one control "
            "update a step, its default sensors; crazyflow: 1024 worlds, JAX on the processor, "
            "single precision, first principles at 1 kHz, state control at 500 Hz",
        ],
    )
    vehicles, rounds = size.of((8, 15), (2, 2), (1, 1))
    rotorpy = _rotorpy(report, size.of(0.5, 0.3, 0.05))
    methods: dict[str, Method] = {
        TRUE: _batch(vehicles, True, 1),
        FULL: _batch(vehicles, False, 1),
        ALIKE: _twin(compiled_twin, vehicles),
    }
    cores = os.cpu_count() or 1
    together = f"{FULL}, {cores} threads"
    if cores > 1:
        methods[together] = _batch(vehicles * cores, False, cores)
    for name, flags in TWINS.items():
        try:
            methods[name] = _twin(CppTwin(flags).fly_true_state, vehicles)
        except FileNotFoundError as error:
            report.notes.append(str(error))
    crazyflow: list[Crazyflow] = []
    methods |= rotorpy | _crazyflow(report, crazyflow, size.of(100, 20, 2))

    wall, cpu, errors = _in_turns(methods, rounds)
    for peer in crazyflow:
        peer.close()
    for name in methods:
        figures: dict[str, float | str] = {
            "steps a second": float(np.median(wall[name])),
            "a CPU second": float(np.median(cpu[name])),
        }
        rms = errors[name]
        if rms is not None:
            figures["error, mm rms"] = 1e3 * rms
        report.rows.append(Row(name, figures))

    def target(what: str, ratio: np.ndarray, limit: float) -> None:
        report.targets.append(Target(what, float(np.median(ratio)), limit, at_most=False))

    target("true state, steps a CPU second", cpu[TRUE], 3.3e6)
    target("sensors and filter, steps a CPU second", cpu[FULL], 3.3e6)
    if CPP in methods:
        target("the work of the C++ twin, compiled over C++ -O3", cpu[ALIKE] / cpu[CPP], 0.97)
        whole = float(np.median(cpu[TRUE] / cpu[CPP]))
        report.notes.append(
            f"true state, compiled over C++ -O3: {whole:.2f}; the twin has no ground, no load, no "
            "drag of rotors, no centre of mass or products of inertia, and no figures of a flight"
        )
    if ROTORPY in methods:
        target("true state, times RotorPy", cpu[TRUE] / cpu[ROTORPY], 3000.0)
        target("sensors and filter, times RotorPy", cpu[FULL] / cpu[ROTORPY], 3000.0)
    if cores > 1:
        # Of the fastest rounds: the target is for idle cores, and other programs use them too.
        target(f"{cores} threads over one", wall[together].max() / wall[FULL].max(), 0.9 * cores)
        median = float(np.median(wall[together] / wall[FULL]))
        report.notes.append(
            f"threads over one: fastest round of each; the median of the rounds is {median:.2f}; "
            f"load of the machine at the end {os.getloadavg()[0]:.2f}"
        )
    report.plot = {
        "kind": "figures",
        "labels": list(methods),
        "values": [float(np.median(cpu[name])) for name in methods],
        "x_label": "steps a CPU second",
    }
    return report


def _in_turns(
    methods: dict[str, Method], rounds: int
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, float | None]]:
    """Return steps per second of wall and processor time (rounds,), and last error, by method."""
    for method in methods.values():
        method()  # compile, fill caches
    wall: dict[str, list[float]] = {name: [] for name in methods}
    cpu: dict[str, list[float]] = {name: [] for name in methods}
    errors: dict[str, float | None] = {}
    for _ in range(rounds):
        for name, method in methods.items():
            began, busy = time.perf_counter(), time.process_time()
            steps, errors[name], elsewhere = method()
            wall[name].append(steps / (time.perf_counter() - began))
            cpu[name].append(steps / (elsewhere or time.process_time() - busy))
    return (
        {name: np.array(values) for name, values in wall.items()},
        {name: np.array(values) for name, values in cpu.items()},
        errors,
    )


def _batch(vehicles: int, true_state: bool, threads: int) -> Method:
    scenarios = [
        Scenario(seed=k, true_state=true_state, whole_references=not true_state)
        for k in range(vehicles)
    ]
    hover = 0.0 if true_state else HOVER

    def fly() -> tuple[float, float, None]:
        flights = fly_batch(scenarios, hover + SECONDS, hover=hover, threads=threads)
        if flights.crashed.any():
            raise RuntimeError(f"a flight of the benchmark crashed: {flights.summary()}")
        error = float(np.median(flights.outcome["position_rms"]))
        return vehicles * 1e3 * (hover + SECONDS), error, None

    return fly


def compiled_twin(settings: Record, plant: Record, onboard: Record, ticks: int, dt: float) -> float:
    """Fly the twin's work in our own compiled code; return the rms position error, m."""
    return fly_true_state(settings, plant, onboard, ticks, dt, round(dt / 0.001))


def _twin(twin: Callable[[Record, Record, Record, int, float], float], vehicles: int) -> Method:
    scenario = Scenario(true_state=True, whole_references=False)
    cases, plants = prepare([scenario])

    def fly() -> tuple[float, float, None]:
        error = 0.0
        for _ in range(vehicles):
            ticks, plant = round(500 * SECONDS), plants.copy()
            error = twin(cases["settings"], plant, new_onboard(), ticks, 0.002)
        return vehicles * 1e3 * SECONDS, error, None

    return fly


def _rotorpy(report: Report, seconds: float) -> dict[str, Method]:
    try:
        from benchmarks.peers.rotorpy_flight import RotorPy

        flight = RotorPy()
    except ImportError as error:
        report.notes.append(f"RotorPy left out: {error}")
        return {}
    return {ROTORPY: lambda: (*flight.fly(seconds), None)}


def _crazyflow(report: Report, started: list[Crazyflow], steps: int) -> dict[str, Method]:
    try:
        flights = {name: Crazyflow(name) for name in ("rk4", "symplectic_euler")}
    except ImportError as error:
        report.notes.append(f"crazyflow left out: {error}")
        return {}

    started.extend(flights.values())

    def method(flight: Crazyflow) -> Method:
        def fly() -> tuple[float, None, float]:
            done, busy = flight.fly(steps)
            return done, None, busy

        return fly

    return {f"crazyflow, {WORLDS} worlds, {name}": method(f) for name, f in flights.items()}
