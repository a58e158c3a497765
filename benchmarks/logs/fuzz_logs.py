"""Mutated and crafted logs read by all readers of logs, with the memory that each command needs.

    python -m benchmarks fuzz_logs [--count N] [--seed N]

The commands run one after another in a worker (benchmarks/logs/fuzz_worker.py), which is restarted
when it has grown, so that one command's memory is not counted as another's.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from benchmarks.harness import Report, Row, Size, Target
from tests.crafted_logs import CRAFTED, mutated, sound

COUNT = 500, 20, 2  # of each size
MOST_MB = 500.0
GROWN_MB = 400.0
"""Memory of an idle worker, in MB, above which the next command gets a new worker."""
LONGEST = 600.0  # s of a command
LARGE = ("at_the_limit", "many_tiny", "many_loose", "attached", "long_text", "long_array")
"""Crafted logs whose commands have a separate worker each."""


class Worker:
    """Runner of commands in a separate process."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def run(self, command: str, log: Path, out: Path) -> dict[str, Any]:
        """Return status, peak and remaining memory (MB), and the end of its output."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "benchmarks.logs.fuzz_worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        late = threading.Timer(LONGEST, process.kill)
        late.start()
        process.stdin.write(json.dumps([command, str(log), str(out)]) + "\n")
        process.stdin.flush()
        line = process.stdout.readline()
        late.cancel()
        if not line:
            status = process.wait()
            self._process = None
            return {"status": status, "peak": 0.0, "rest": 0.0, "said": "the worker ended"}
        done: dict[str, Any] = json.loads(line)
        if done["rest"] > GROWN_MB:
            self.stop()
        return done

    def stop(self) -> None:
        if self._process is not None:
            with self._process as process:
                assert process.stdin is not None
                process.stdin.close()
            self._process = None


def run(size: Size = Size.FULL, count: int | None = None, seed: int = 0) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    from benchmarks.logs.fuzz_worker import COMMANDS

    count = count or size.of(*COUNT)
    names = [name for name in CRAFTED if size is Size.FULL or name not in LARGE]
    crafted = size.some(names[:count])
    peaks: dict[str, list[float]] = {name: [] for name in COMMANDS}
    refused = dict.fromkeys(COMMANDS, 0)
    problems: list[str] = []
    worker = Worker()
    with tempfile.TemporaryDirectory(prefix="quadlab-fuzz-") as name:
        folder = Path(name)
        whole = sound(folder / "sound.mcap").read_bytes()
        for k in range(count):
            log = folder / f"log{k}.mcap"
            if k < len(crafted):
                what = crafted[k]
                CRAFTED[what](log)
            else:
                what = f"mutation {seed + k - len(crafted)}"
                log.write_bytes(mutated(whole, seed + k - len(crafted)))
            before = _digest(log)
            for command in COMMANDS:
                if what in LARGE:
                    worker.stop()
                done = worker.run(command, log, folder / "out")
                peaks[command].append(done["peak"])
                refused[command] += done["status"] != 0
                is_sound = done["status"] in (0, 1, 2) and done["peak"] <= MOST_MB
                if not is_sound or _digest(log) != before:
                    problems.append(
                        f"{what}, {command}: {done['status']}, {done['peak']:.0f} MB, "
                        f"{done['said'][-200:]}"
                    )
                    print(problems[-1], file=sys.stderr)
                    if _digest(log) != before:
                        problems[-1] += ", the file was changed"
                shutil.rmtree(folder / "out", ignore_errors=True)
            log.unlink()
            if k % 50 == 49:
                print(f"{k + 1} logs, {len(problems)} problems", file=sys.stderr, flush=True)
    worker.stop()
    report = Report(
        "fuzz_logs",
        "Mutated and crafted logs",
        [
            f"{count} logs: {len(crafted)} crafted ones, {count - len(crafted)} mutations from "
            f"number {seed}",
            "problems: an exception, a status that is none of 0, 1, 2, more than "
            f"{MOST_MB:.0f} MB, or a file that was changed",
            "recover: of a copy; page: entered into the catalogue, made ready for replay and read",
            *problems[:20],
        ],
    )
    for command in COMMANDS:
        most = max(peaks[command])
        report.rows.append(
            Row(command, {"logs": count, "refused": refused[command], "most, MB": most})
        )
        report.targets.append(Target(f"{command}: MB", most, MOST_MB))
    report.targets.append(Target("problems", len(problems), 0.0))
    return report


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha1").hexdigest()
