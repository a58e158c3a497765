"""The station's recorder killed (-9) at random moments while data arrives at the full rate.

    python -m benchmarks killed_logs [--quick]

A separate process has the real recorder and a real catalogue, and records what a station receives:
four topics at 500 Hz in packets of five, poses at 100 Hz and slower ones. The next start repairs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.logs.killed_file import Board, Kill, look
from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue, run_name
from console.catalogue.tables import RunEntry
from console.runs.adoption import tidy_runs
from console.runs.recorder import Recorder
from console.runs.run import Run, RunEnd
from flight_log.reader import read_log
from flight_log.run_folder import STATION
from quadrotor.checkout import ROOT
from vehicle_link import messages

PACKET_S = 0.01
MATERIAL_S = 8.0
EARLIEST_S, LATEST_S = 0.3, 2.5
PATIENCE_S = 120.0
MATERIAL, BOARD = "material.mcap", "board"


def kills(count: int, seed: int = 1) -> Iterator[Kill]:
    """Yield `count` processes, one after another, each killed at a random moment."""
    chance = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory(prefix="quadlab-killed-") as name:
        write_run(Path(name) / MATERIAL, MadeRun(MATERIAL_S))
        for number in range(count):
            folder = Path(name) / f"{number}"
            folder.mkdir()
            yield _killed(
                Path(name) / MATERIAL, folder, float(chance.uniform(EARLIEST_S, LATEST_S))
            )


def _killed(material: Path, folder: Path, after_s: float) -> Kill:
    board = Board(folder / BOARD)
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.logs.killed_recorder", str(material), str(folder)],
        cwd=ROOT,
    )
    try:
        end = time.monotonic() + PATIENCE_S
        while board.read()[0] == 0:
            if process.poll() is not None or time.monotonic() > end:
                raise RuntimeError("the recorder's process has put nothing")
            time.sleep(0.01)
        time.sleep(after_s)
    finally:
        process.kill()
        process.wait()
    catalogue = Catalogue(folder)
    try:
        [log] = catalogue.folder.glob(f"*/{STATION}")
        kill = look(log, board, lambda: tidy_runs(catalogue))
        entry = catalogue.get(log.parent.name)
    finally:
        catalogue.close()
    if (entry.complete, entry.recovered, entry.messages) != (True, True, kill.kept):
        return Kill(kill.put, kill.kept, kill.lost_ms, (*kill.problems, f"catalogue: {entry}"))
    return kill


def feed(material: Path, folder: Path) -> None:
    """Feed a recorder until it is killed."""
    catalogue = Catalogue(folder)

    def started(run: Run) -> None:
        catalogue.add(
            RunEntry(
                id=run.run_id,
                vehicle="quad1",
                start_ns=run.start_ns,
                duration=0.0,
                file=run.path.parent.name,
                bytes=0,
                messages=0,
                operator="",
                complete=False,
                recovered=False,
                problem="",
                notes="",
            )
        )

    def ended(end: RunEnd) -> None:
        raise RuntimeError(f"the run ended: {end.problem}")

    packets = _packets(material)
    for kind in {kind for packet in packets for _, kind, _ in packet}:
        # As in a station, which has announced them on the link long before.
        messages.definition(kind), messages.type_hash(kind)
    recorder = Recorder(catalogue.folder, started, ended)
    board = Board(folder / BOARD)
    name = run_name(datetime.now(UTC), "quad1", catalogue.folder)
    recorder.start(
        Run(
            name,
            catalogue.folder / name / STATION,
            {"vehicle": "quad1"},
            time.time_ns(),
            lambda: {"parameters.json": b"{}"},
            keep_free=0,
        )
    )
    count, due = 0, time.monotonic()
    while True:
        for packet in packets:
            now_ns = time.time_ns()
            recorder.put_all(
                [
                    (t, kind, payload, now_ns, count + k)
                    for k, (t, kind, payload) in enumerate(packet)
                ]
            )
            count += len(packet)
            board.note(count, now_ns)
            due = max(due + PACKET_S, time.monotonic() - 0.1)
            time.sleep(max(0.0, due - time.monotonic()))


def _packets(material: Path) -> list[list[tuple[str, str, bytes]]]:
    """Return the messages of each hundredth of a second."""
    packets: dict[int, list[tuple[str, str, bytes]]] = {}
    first: Any = None
    for message in read_log(material):
        first = message.publish_ns if first is None else first
        place = int((message.publish_ns - first) * 1e-9 / PACKET_S + 1e-6)
        kind = message.type_name.replace("/msg/", "/")
        packets.setdefault(place, []).append((message.topic, kind, message.payload))
    return [packets[place] for place in sorted(packets)]


if __name__ == "__main__":
    feed(Path(sys.argv[1]), Path(sys.argv[2]))
