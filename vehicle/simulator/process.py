"""The simulated vehicle in real time, behind two pseudo-terminals (`quadlab simulator`).

Time. Sample k is taken at start + k / rate on the monotonic clock and takes 3 ms on the line.
Truth is stamped with the host's epoch time at the start plus k / rate; the vehicle stamps the same
sample with its own estimate of the same constant (vehicle.microcontroller_clock), so the two agree
to the least delay of a sample on its way, well below 2 ms, while both hosts are one.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from vehicle.simulator.live_parameters import LiveParameters
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.pseudo_terminal import PseudoTerminal
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.simulator.truth import TruthPublisher, connect_to_station
from vehicle.simulator.uart import Uart

PRIORITY = 40
"""SCHED_FIFO, below the flight process: late samples would look like a late flight loop."""
TRUTH_RATE = 100
MIN_PAUSE_S = 0.0004
"""s between two steps when behind: leaves the flight stack time to answer each sample."""
GIVE_UP_NS = 1_000_000_000
"""Further behind (the machine slept), the samples in between are lost instead of caught up."""
SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class RunStatistics:
    """What a run came to."""

    periods: int = 0  # of the microcontroller
    lost_samples: int = 0  # the machine slept
    dropped_bytes: int = 0  # nobody read them
    overruns: int = 0  # bytes the wire was too slow for
    dropped_truth: int = 0  # the network was too slow


def run(
    parameters: SimulatorParameters,
    folder: Path,
    loopback_port: int | None,
    *,
    vehicle: str = "quad1",
    stop: threading.Event | None = None,
) -> RunStatistics:
    """Fly until `stop` is set, or without one until SIGTERM or SIGINT.

    Args:
        folder: where the links `mcu0` and `mcu1` to the serial devices are made.
        loopback_port: of the station's router; None publishes no truth.

    Raises StorageError when the links cannot be made.
    """
    if stop is None:
        stop = _stop_on_signals()
    terminals: list[PseudoTerminal] = []
    lines: list[Uart] = []
    publisher = None
    # Before there are devices: who finds one may take it that the microcontroller is switched on.
    SimulatedVehicle(parameters).warm_up()
    try:
        for index in (0, 1):
            terminals.append(PseudoTerminal(folder / f"mcu{index}"))
            lines.append(Uart(terminals[-1]))
        simulated = SimulatedVehicle(parameters, lines)
        live = LiveParameters(parameters)
        if loopback_port is not None:
            connect = connect_to_station(loopback_port, vehicle, live)
            publisher = TruthPublisher(connect, vehicle)
        _say(
            f"microcontroller at {terminals[0].link} and {terminals[1].link}, "
            f"{parameters.imu_rate} Hz{_ask_for_priority()}"
        )
        gc.collect()
        gc.freeze()
        statistics = _loop(simulated, lines, live, publisher, stop)
        statistics.dropped_bytes = sum(line.terminal.dropped for line in lines)
        statistics.overruns = sum(line.overruns for line in lines)
        if publisher is not None:
            statistics.dropped_truth = publisher.dropped
        return statistics
    finally:
        if publisher is not None:
            publisher.close()
        for terminal in terminals:
            terminal.close()


def _loop(
    simulated: SimulatedVehicle,
    lines: list[Uart],
    live: LiveParameters,
    publisher: TruthPublisher | None,
    stop: threading.Event,
) -> RunStatistics:
    statistics = RunStatistics()
    truth_due_ns = 0
    epoch_ns, start_ns = time.time_ns(), time.monotonic_ns()
    while not stop.is_set():
        due_ns = start_ns + simulated.next_period_ns
        wait_ns = due_ns - time.monotonic_ns()
        if wait_ns < -GIVE_UP_NS:
            lost = -wait_ns // simulated.sample_period_ns
            simulated.skip(lost)
            statistics.lost_samples += lost
            _say(f"this machine stopped for {-wait_ns * 1e-9:.1f} s; {lost} samples are lost")
            continue
        time.sleep(max(wait_ns * 1e-9, MIN_PAUSE_S))
        changed = live.take()
        if changed is not None:
            simulated.configure(changed)
        for line in lines:
            line.advance(simulated.period)
        simulated.step_period()
        statistics.periods += 1
        if publisher is None:
            continue
        reading = simulated.bench_reading()
        if reading is not None:
            publisher.offer_reading(epoch_ns + reading.stamp_ns, reading)
        if simulated.stamp_ns >= truth_due_ns:
            truth_due_ns = simulated.stamp_ns + SECOND_NS // TRUTH_RATE
            publisher.offer(epoch_ns + simulated.stamp_ns, simulated.truth)
    return statistics


def _ask_for_priority() -> str:
    """SCHED_FIFO for this thread; what to add to the first line when refused."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError as error:
        return f", not real time (SCHED_FIFO: {error.strerror}): samples come late under load"
    return ""


def _stop_on_signals() -> threading.Event:
    stop = threading.Event()

    def on_signal(number: int, frame: object) -> None:
        stop.set()

    signal.signal(signal.SIGTERM, on_signal)
    signal.signal(signal.SIGINT, on_signal)
    return stop


def _say(line: str) -> None:
    print(f"simulator: {line}", file=sys.stderr, flush=True)
