"""A recorded run over a link that breaks a hundred times, completed from the vehicle's own log.

Part of `python -m benchmarks link`. The whole laboratory: `quadlab simulator` and `quadlab station`
at one end of the link, `quadlab vehicle` at the other. The vehicle is armed on the ground, because
in flight it lands soon after the station falls silent; its log is written as in flight. After
disarming the station compares, fetches and fills by itself; then the run is compared with the
vehicle's log here, tick by tick, outage by outage.
"""

from __future__ import annotations

import os
import random
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.impairment.link import A, B, ImpairedLink
from benchmarks.link.outages import BETWEEN, COUNT, LONGEST, SHORTEST, Outage
from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import Completeness, completeness_of
from flight_log.reader import read_log
from quadlab.station_client import StationClient, station
from quadrotor.checkout import ROOT
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from vehicle_link.security.authority import ensure_certificates

PORT = 7447
TICKS = "/quad1/state"
PATIENCE, FILLING = 90.0, 900.0  # s
WARM = 3
MB = 1e6


def filled(size: Size = Size.FULL) -> Report:
    """Measure how many outages left no hole, how long filling took, and the station's memory.

    Raises StorageError where namespaces are not allowed, QuadlabError when an end fails.
    """
    count = size.of(*COUNT)
    drawn = random.Random(9)
    with tempfile.TemporaryDirectory(prefix="quadlab-filled-") as name, ImpairedLink(9) as link:
        folder = Path(name)
        board, data = folder / "vehicle", folder / "station"
        ensure_certificates(board / "certificates", [A])
        os.symlink(board / "certificates", _made(data) / "certificates")
        loopback = ["--loopback-port", str(PORT)]
        ports = [str(folder / port) for port in ("mcu0", "mcu1")]
        program = [sys.executable, "-m", "quadlab"]
        link.run(B, [*program, "simulator", "--folder", name, *loopback], cwd=ROOT)
        _until(lambda: all(Path(port).exists() for port in ports), "the simulator")
        link.run(A, [*program, "vehicle", "--serial", *ports, "--data", str(board)], cwd=ROOT)
        base = link.run(
            B,
            [*program, "station", "--vehicle", f"{A}:{PORT}", "--data", str(data), *loopback],
            cwd=ROOT,
        )
        pilot = link.run(
            B, [sys.executable, "-m", "benchmarks.logs.filled"], cwd=ROOT, stdin=-1, stdout=-1
        )
        _hear(pilot, b"armed\n")
        outages, memory = [], [_memory(base.pid)]
        for _ in range(count):
            length = drawn.uniform(SHORTEST, size.of(*LONGEST))
            begin = time.time_ns()
            link.interrupt(length)
            time.sleep(length + BETWEEN + drawn.uniform(0.0, 0.1))
            outages.append(Outage(begin, begin + round(length * 1e9)))
            memory.append(_memory(base.pid))
        began = time.monotonic()
        _say(pilot, b"disarm\n")
        _hear(pilot, b"disarmed\n")
        run, verdict = _verdict(data)
        seconds = time.monotonic() - began
        ours = _ticks([run])
        theirs = _ticks(sorted((board / "onboard").glob("*.mcap")))
    return _report(outages, ours, theirs, verdict, seconds, memory)


def _report(
    outages: list[Outage],
    ours: npt.NDArray[np.int64],
    theirs: npt.NDArray[np.int64],
    verdict: Completeness,
    seconds: float,
    memory: list[float],
) -> Report:
    lacking = theirs[~np.isin(theirs, ours)]
    whole = unlogged = 0
    for outage in outages:
        logged = (theirs >= outage.begin) & (theirs <= outage.end)
        lacks = (lacking >= outage.begin) & (lacking <= outage.end)
        whole += bool(logged.any()) and not lacks.any()
        unlogged += not logged.any()
    report = Report("filled", "Filled", [f"the whole laboratory, {len(outages)} outages in a run"])
    report.rows.append(
        Row(
            f"run of {len(outages)} outages, filled from the vehicle's log",
            {
                "ticks on board": len(theirs),
                "lacking in the run": len(lacking),
                "filled, s": verdict.filled,
                "filled after, s": seconds,
                "station's memory, MB": f"{memory[0]:.0f} to {memory[-1]:.0f}",
            },
        )
    )
    missing = len(outages) - whole
    growth = memory[-1] - memory[min(WARM, len(memory) - 1)]
    report.targets = [
        Target(f"outages of {len(outages)} with a tick missing after filling", missing, 0),
        Target("ticks missing in the whole run", len(lacking), 0),
        Target("memory of the whole station, + MB", growth, 8.0),
    ]
    report.notes.append(f"the run says: {verdict.line}")
    if unlogged:
        report.notes.append(
            f"{unlogged} outages came when the vehicle had disarmed by itself, which it does where "
            "the simulator's machine stands still: of those nothing is said, nor are they counted "
            "as whole"
        )
    return report


def _ticks(logs: list[Path]) -> npt.NDArray[np.int64]:
    """Return the stamps of all ticks, in order and without duplicates."""
    found = [message.publish_ns for log in logs for message in read_log(log, topics=[TICKS])]
    return np.unique(np.array(found, np.int64))


def _verdict(data: Path) -> tuple[Path, Completeness]:
    """Return the log of the only run, and the station's report of it once it has decided."""
    end = time.monotonic() + FILLING
    while time.monotonic() < end:
        catalogue = Catalogue(data)
        try:
            runs = catalogue.runs()
            for run, found in completeness_of(catalogue, [one.id for one in runs]).items():
                if found.state != "open":
                    [entry] = [one for one in runs if one.id == run]
                    return catalogue.folder / entry.file, found
        finally:
            catalogue.close()
        time.sleep(0.5)
    raise QuadlabError(f"the run was not filled within {FILLING:.0f} s")


def _memory(pid: int) -> float:
    """Return the resident memory in MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MB


def _until(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise QuadlabError(f"{what} did not come up within {PATIENCE:.0f} s")
        time.sleep(0.05)


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True)
    return folder


def _say(program: Any, line: bytes) -> None:
    program.stdin.write(line)
    program.stdin.flush()


def _hear(program: Any, line: bytes) -> None:
    came = program.stdout.readline()
    if came != line:
        raise QuadlabError(f"the pilot said {came!r} instead of {line!r}; see its lines above")


def pilot() -> None:
    """Arm at the station, and disarm on command."""
    end = time.monotonic() + PATIENCE
    while True:
        with suppress(LinkError), station(PORT, "quad1") as client:
            statuses = client.listen("status")
            _do(client, "arm", end)
            _wait(statuses, True)
            print("armed", flush=True)
            sys.stdin.readline()
            _do(client, "disarm", time.monotonic() + PATIENCE)
            _wait(statuses, False)
            print("disarmed", flush=True)
            return
        if time.monotonic() > end:
            raise SystemExit("the pilot found no station")


def _do(client: StationClient, what: str, end: float) -> None:
    while True:
        try:
            client.ask(what)
            return
        except (RefusedError, LinkError) as error:
            if time.monotonic() > end:
                raise SystemExit(f"{what}: {error}") from None
        time.sleep(1.0)


def _wait(statuses: Any, armed: bool) -> None:
    while statuses.get(timeout=PATIENCE).armed != armed:
        pass


if __name__ == "__main__":
    pilot()
