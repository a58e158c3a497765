"""Control laws of every door fly the figure 8: how much worse than the built-in law, and how long
their answers take.

    python -m benchmarks foreign_laws

The law is that of `quadlab new law` in Python, in an FMU (pythonfmu3), in Octave over UDP, and ours
in an FMU in C (gcc). In simulated time the vehicle waits for each answer and flies it one tick
later. The time of an answer is measured from sending the input until the answer is there, with
nothing else to do meanwhile; in real time one that takes longer than a tick would be missed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target, free_port
from quadrotor.checkout import ROOT
from quadrotor.parameter_description import ParameterValue
from vehicle.laws.contract import LAW
from vehicle.plugins.links import Link

LAPS, PERIOD = 2, 0.002
EXAMPLES = ROOT / "examples" / "laws"
Settings = dict[str, ParameterValue]


class Timed:
    """A link that waits for each answer at once, and notes how long (s) that took."""

    def __init__(self, link: Link) -> None:
        self._link, self.trips = link, list[float]()
        self._answer: bytes | None = None

    def ready(self) -> bool:
        return self._link.ready()

    def send(self, data: bytes) -> None:
        began = perf_counter()
        self._link.send(data)
        if len(data) == LAW.inputs.itemsize:
            self._answer = self._link.receive()
            self.trips.append(perf_counter() - began)

    def receive(self) -> bytes | None:
        answer, self._answer = self._answer, None
        return answer

    def close(self) -> None:
        self._link.close()


@contextmanager
def built_in(folder: Path) -> Iterator[Settings]:
    yield {}


@contextmanager
def python(folder: Path) -> Iterator[Settings]:
    shutil.copy(EXAMPLES / "geometric_pid.py", folder / "mine.py")
    yield {"control.law": "mine"}


@contextmanager
def fmu_of_gcc(folder: Path) -> Iterator[Settings]:
    from extensions.fmu.description import export_fmu

    export_fmu("law", [], folder / "mine.fmu")
    yield {"control.law": "mine"}


@contextmanager
def fmu_of_python(folder: Path) -> Iterator[Settings]:
    from pythonfmu3.builder import FmuBuilder

    os.environ["QUADLAB_ROOT"] = str(ROOT)  # for the law's process
    source = Path(__file__).with_name("fmi3_geometric.py")
    built: Path = FmuBuilder.build_FMU(source, dest=folder, needsExecutionTool="false")
    built.rename(folder / "mine.fmu")
    yield {"control.law": "mine"}


@contextmanager
def octave(folder: Path) -> Iterator[Settings]:
    ours, theirs = free_port(), free_port()
    script = str(EXAMPLES / "geometric_udp.m")
    words = ["octave-cli", "--quiet", script, str(theirs), str(ours)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as peer:
        try:
            assert peer.stdout is not None
            peer.stdout.readline()
            peer_address = f"127.0.0.1:{theirs}"
            own: Settings = {
                "control.plugin.udp_peer": peer_address,
                "control.plugin.udp_port": ours,
            }
            yield {"control.law": "udp", **own}
        finally:
            peer.kill()


DOORS: dict[str, tuple[Callable[..., object], float]] = {
    "built in": (built_in, 1.0),
    "Python plugin": (python, 1.1),
    "FMU from gcc": (fmu_of_gcc, 1.2),
    "FMU from pythonfmu3": (fmu_of_python, 1.3),
    "Octave over UDP": (octave, 1.5),
}
"""Each law, and its largest rms distance from the reference as a multiple of the built-in law's."""

PROGRAMS: dict[Callable[..., object], str] = {fmu_of_gcc: "gcc", octave: "octave-cli"}
"""Programs of others without which a law is not flown."""


def fly(settings: Settings, folder: Path, seed: int, size: Size) -> tuple[float, list[float], int]:
    """Return the rms distance (m) from the reference on the 8, times of answers, missed answers."""
    flight, seconds = WatchedFlight(seed, settings, plugins=folder), size.of(60.0, 60.0, 0.5)
    external, trips = flight.stack.law.external, list[float]()
    if external is not None:
        timed = external._link = Timed(external._link)
        trips = timed.trips
    try:
        flight.hover(size.of(1.0, 1.0, 0.6), size.of(3.0, 3.0, 0.2))
        flight.forget()
        flight.start("follow_trajectory", trajectory="figure_eight", laps=LAPS)
        end = flight.view().time + seconds
        flight.wait_until(
            lambda v: v.behavior == "hover" or v.time > end, what="the end of the 8", timeout=60
        )
        _, places, wanted = flight.trace()
        if external is not None and flight.stack.law.external is not external:
            raise RuntimeError(f"the law is out: {flight.events.texts[-3:]}")
        missed = external.missed if external is not None else 0
    finally:
        flight.stack.close()
    return float(np.sqrt(np.mean(np.sum((places - wanted) ** 2, axis=1)))), trips, missed


def run(size: Size = Size.FULL, seed: int = 1) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    found = Report(
        "foreign_laws",
        "Control laws of other tools",
        [
            f"{LAPS} laps of the figure 8 in simulated time at 500 Hz, seed {seed}, full sensors",
            "every law but the built-in one acts one tick (2 ms) later",
        ],
    )
    reference = 1.0
    for name, (door, most) in DOORS.items():
        if door in PROGRAMS and shutil.which(PROGRAMS[door]) is None:
            found.notes.append(f"{name}: not flown, {PROGRAMS[door]} is not installed")
            continue
        with tempfile.TemporaryDirectory() as folder, door(Path(folder)) as settings:  # type: ignore[attr-defined]
            error, trips, missed = fly(settings, Path(folder), seed, size)
        reference = error if door is built_in else reference
        figures: dict[str, float | str] = {"rms, mm": 1e3 * error, "ratio": error / reference}
        if trips:
            figures |= {
                "answer, ms, median": 1e3 * float(np.median(trips)),
                "answer, ms, 99 %": 1e3 * float(np.quantile(trips, 0.99)),
                "later than a tick, %": 100.0 * float(np.mean(np.array(trips) > PERIOD)),
                "missed": float(missed),
            }
            found.targets.append(Target(f"{name}, ratio", error / reference, most))
        found.rows.append(Row(name, figures))
    return found
