"""Both serial ports at 115200 Bd for a minute: samples, losses, and the latency from IMU to motors.

    python -m benchmarks serial_line

Real processes: the simulator behind two pseudo-terminals, paced as the wire, and the flight process
with its whole stack, which flies the figure 8. The benchmark acts as tracking system and comms.

Latency is measured inside the simulator, at the microcontroller's two ends of the path: from the
period that takes an IMU sample and queues its frame to the end of the period that sets the
references answering it on the motors' bus. The flight process notes which sample a command answers,
for every command in the order of its port; as the simulator notes every command that arrives whole,
the two lists of a port match, provided that none is lost, which is checked. Samples are identified
by the milliseconds that they carry. The path contains 34 bytes to the computer (2.95 ms), its
wake-up and tick, 14 bytes back (1.22 ms), and the waits for the microcontroller's next period (1 ms
long): 5 ms when the computer answers within the rest of a period.

It is measured by two clocks: the microcontroller's, by which the vehicle flies, and the host's,
which also shows delays of the simulator's own process. Bytes of a terminal pass through a kernel
thread of ordinary priority, so this needs an idle machine; run it as root, or with the real-time
rights of docs/page/setup.md.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.onboard.flight_under_test import FlightUnderTest, Notes
from benchmarks.onboard.recorded_simulator import HEADER
from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError
from quadrotor.records import Record, pose_sample
from vehicle.simulator.firmware.firmware import START_MS
from vehicle_link.serial.ids import TIME_PERIOD_MS
from vehicle_link.topics.ticks import decode_odometry

RATE = 500
SECONDS = 60, 8, 1  # of each size
LATENCY_MS = 6.0
MS = 1_000_000
SETTLING_S = 0.3
"""Time, in s, for what is on the line when the flight process ends."""
Table = npt.NDArray[np.int64]


class PipedTruth:
    """The simulator's truth as poses."""

    def __init__(self) -> None:
        self._reader, self.writer = os.pipe()
        os.set_blocking(self._reader, False)
        self._data = b""

    def poses(self) -> list[Record]:
        """Return the poses that arrived since the last call."""
        try:
            self._data += os.read(self._reader, 65536)
        except BlockingIOError:
            return []
        found = []
        while len(self._data) >= HEADER.size:
            stamp_ns, length = HEADER.unpack_from(self._data)
            end = HEADER.size + length
            if len(self._data) < end:
                break
            _, state = decode_odometry(self._data[HEADER.size : end])
            self._data = self._data[end:]
            found.append(pose_sample(stamp_ns, state["position_w"][0], state["quaternion_wb"][0]))
        return found

    def close(self) -> None:
        os.close(self._reader)
        os.close(self.writer)


def run(size: Size = Size.FULL) -> Report:
    """Fly over serial lines. Raises QuadlabError when the vehicle does not fly."""
    seconds = size.of(*SECONDS)
    with tempfile.TemporaryDirectory() as name:
        flight, robot, window, rights = _fly(Path(name), seconds)
    began_ns, ended_ns = window
    report = Report(
        "serial_line",
        "Two serial ports at 115200 Bd",
        [
            f"simulator and flight process as in flight, {RATE} Hz, figure 8, {seconds} s",
            f"flight process: {rights}",
            "latency: from the period of the sample to the end of the period of the references",
        ],
    )
    sent = _between(robot["samples"], 1, began_ns, ended_ns)
    ticks = _between(flight["ticks"], 2, began_ns, ended_ns)
    samples = _sample_ms(ticks[:, 0], flight["clock"])
    lost = len(_between(robot["samples"] // MS, 0, samples[0], samples[-1] + 1)) - len(samples)
    arrived = _between(robot["commands"], 2, began_ns, ended_ns)
    overruns, missed, damaged = flight["counts"].tolist()
    report.rows.append(
        Row(
            "rates",
            {
                "samples sent, 1/s": len(sent) / seconds,
                "ticks, 1/s": len(ticks) / seconds,
                "commands at the motors, 1/s": len(arrived) / seconds,
                "frames lost": float(lost),
            },
        )
    )
    by_vehicle, by_host = latencies(flight, robot, began_ns, ended_ns)
    for clock, latency in (("microcontroller's clock", by_vehicle), ("host's clock", by_host)):
        report.rows.append(
            Row(
                f"latency, {clock}",
                {
                    "p50, ms": float(np.median(latency)),
                    "p99, ms": float(np.percentile(latency, 99)),
                    "longest, ms": float(latency.max()),
                },
            )
        )
    report.targets = [
        Target("IMU samples a second, heard", len(ticks) / seconds, 0.999 * RATE, at_most=False),
        Target("frames lost", lost, 0),
        Target("commands over ticks", len(arrived) / len(ticks), 0.999, at_most=False),
        Target("latency p99, ms, host's clock", float(np.percentile(by_host, 99)), LATENCY_MS),
    ]
    report.notes.append(
        f"since the start of the flight process: {overruns} overruns, {missed} missed frames, "
        f"{damaged} damaged frames"
    )
    return report


def latencies(
    flight: Notes, robot: Notes, began_ns: int, ended_ns: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the ms from sample to motors of the commands (N,), by both clocks.

    The first is by the microcontroller's clock, the second by the host's.

    Args:
        began_ns, ended_ns: of the window, by the host's clock.

    Raises QuadlabError when a command is lost, as the others then cannot be matched.
    """
    by_vehicle, by_host = [], []
    taken_ms = robot["samples"][:, 0] // MS
    for port in (0, 1):
        written = flight["commands"][flight["commands"][:, 0] == port]
        arrived = robot["commands"][robot["commands"][:, 0] == port]
        if len(written) != len(arrived):
            raise QuadlabError(
                f"{len(written)} commands written on port {port}, {len(arrived)} arrived: "
                "they cannot be matched"
            )
        inside = (arrived[:, 2] >= began_ns) & (arrived[:, 2] < ended_ns)
        written, arrived = written[inside], arrived[inside]
        bus_ms = arrived[:, 1] // MS
        elapsed_ms = (bus_ms - _sample_ms(written[:, 1], flight["clock"])) % TIME_PERIOD_MS
        by_vehicle.append(elapsed_ms)
        rows = np.searchsorted(taken_ms, bus_ms - elapsed_ms)
        by_host.append((arrived[:, 2] - robot["samples"][rows, 1]) / MS)
    return np.concatenate(by_vehicle).astype(np.float64), np.concatenate(by_host)


def _sample_ms(stamps_ns: Table, clock: Table) -> Table:
    """Return the ms of the microcontroller's clock as in its samples, but not modulo a minute."""
    epoch_ns, elapsed_ms, last_ms = clock.tolist()
    carried_ms = last_ms - elapsed_ms + (stamps_ns - epoch_ns) // MS
    told_ms: Table = carried_ms - START_MS + _minutes(elapsed_ms, last_ms) * TIME_PERIOD_MS
    return told_ms


def _minutes(elapsed_ms: int, last_ms: int) -> int:
    """Return how often the carried time wrapped; the flight process started in the first minute."""
    began_ms = (last_ms - elapsed_ms - START_MS) % TIME_PERIOD_MS
    return (began_ms - (last_ms - elapsed_ms - START_MS)) // TIME_PERIOD_MS


def _between(table: Table, column: int, first: int, end: int) -> Table:
    return table[(table[:, column] >= first) & (table[:, column] < end)]


def _fly(folder: Path, seconds: int) -> tuple[Notes, Notes, tuple[int, int], str]:
    """Return notes of flight process and simulator, the window by the host's clock, and rights."""
    truth, out = PipedTruth(), folder / "robot.npz"
    robot = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "benchmarks.onboard.recorded_simulator",
            str(folder),
            str(out),
            str(truth.writer),
        ],
        cwd=ROOT,
        pass_fds=(truth.writer,),
    )
    try:
        ports = [str(folder / f"mcu{index}") for index in (0, 1)]
        _await(ports)
        with FlightUnderTest(folder, RATE, ports, truth.poses) as flight:
            flight.take_off()
            rights = flight.rights
            began_ns = time.monotonic_ns()
            flight.fly(seconds)
            ended_ns = time.monotonic_ns()
            flown = flight.stop()
        time.sleep(SETTLING_S)
        robot.send_signal(signal.SIGTERM)
        robot.wait(10.0)
        with np.load(out) as notes:
            simulated = {name: notes[name] for name in notes.files}
    finally:
        if robot.poll() is None:
            robot.kill()
            robot.wait()
        truth.close()
    return flown, simulated, (began_ns, ended_ns), rights


def _await(ports: list[str], longest: float = 60.0) -> None:
    end = time.monotonic() + longest
    while not all(Path(port).exists() for port in ports):
        if time.monotonic() > end:
            raise QuadlabError("the simulator does not start")
        time.sleep(0.05)
