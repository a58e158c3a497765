"""Looking at a run and filling it, in a process of its own at low priority.

`python -m console.transfers.process` takes one line of JSON on its standard input, prints its
progress (0 to 1, a line each) and answers with one line of JSON. When its standard input closes
the station is gone, and it ends too.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError, StorageError

NICENESS = 15
POLL = 0.1
MODULE = "console.transfers.process"


def run_process(
    job: Mapping[str, Any],
    check: Callable[[], None],
    progress: Callable[[float], None] = lambda share: None,
    module: str = MODULE,
) -> dict[str, Any]:
    """Run the process and return its answer. `check` is called again and again and may raise, which
    ends the process.

    Raises StorageError with the reason it failed for.
    """
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
    process = subprocess.Popen(
        [sys.executable, "-m", module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
    )
    answer: dict[str, Any] = {}
    said: list[str] = []

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            told = json.loads(line)
            if isinstance(told, dict):
                answer.update(told)
            else:
                progress(float(told))

    def complaints() -> None:
        assert process.stderr is not None
        said.extend(process.stderr)

    threads = [threading.Thread(target=one, daemon=True) for one in (listen, complaints)]
    try:
        assert process.stdin is not None
        for thread in threads:
            thread.start()
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        while threads[0].is_alive():
            threads[0].join(POLL)
            check()
    except BrokenPipeError:
        pass  # it says why it ended, or that is told below
    finally:
        process.kill() if threads[0].is_alive() else None
        process.wait()
        for thread in threads:
            thread.join()
        for stream in (process.stdin, process.stdout, process.stderr):
            if stream is not None and not stream.closed:
                stream.close()
    if "error" in answer:
        raise StorageError(str(answer["error"]))
    if not answer:
        why = said[-1].strip() if said else "it said nothing"
        raise StorageError(f"{job['act']} of a run failed (status {process.returncode}): {why}")
    return answer


def look(job: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a run has. Times in ns of the vehicle's clock."""
    from flight_log.run_index import index_run

    index = index_run(Path(job["run"]))
    ticks = index.ticks
    return {
        "ticks": len(ticks),
        "period_ns": index.period_ns,
        "holes": index.holes(),
        "gaps": index.gaps(),
        "first_ns": int(ticks[0]) if len(ticks) else 0,
        "last_ns": int(ticks[-1]) if len(ticks) else 0,
        "delay_ns": index.delay_ns,
        "began_ns": index.first_received_ns - index.delay_ns,
        "ended_ns": index.last_received_ns - index.delay_ns,
    }


def fill(job: Mapping[str, Any], progress: Callable[[float], None]) -> dict[str, Any]:
    """Fill what `sources` have; nothing is written when there is nothing to fill."""
    from flight_log.fill import filled_before, write_filled
    from flight_log.fill_source import FillSource
    from flight_log.filling import Filling
    from flight_log.run_index import index_run

    run = Path(job["run"])
    index = index_run(run)
    sources = [
        FillSource(
            one["name"],
            Path(one["path"]),
            tuple((b, e) for b, e in one["ranges"]),
            {int(number): (topic, kind) for number, (topic, kind) in one["channels"].items()},
        )
        for one in job["sources"]
    ]
    filling = Filling(index, sources, job["since_ns"], job["until_ns"])
    found = filling.look()
    before = filled_before(index)
    files = sorted({*before["files"], *(source.name for source in sources)})
    ticks = before["ticks"] + found.ticks
    answer = {**asdict(found), "filled_ticks": ticks, "files": files}
    if found.messages and job["write"]:
        told = {
            "files": json.dumps(files),
            "messages": str(before["messages"] + found.messages),
            "ticks": str(ticks),
            "seconds": f"{ticks * found.period_ns * 1e-9:.3f}",
            **{name: str(text) for name, text in job["told"].items()},
        }
        write_filled(run, index, filling, told, progress)
    return answer


def main() -> int:
    job = json.loads(sys.stdin.readline())
    threading.Thread(target=_end_with_station, daemon=True).start()
    os.nice(NICENESS)
    answered = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever prints must not come between

    def say(told: Any) -> None:
        print(json.dumps(told), file=answered, flush=True)

    try:
        say(look(job) if job["act"] == "look" else fill(job, say))
    except QuadlabError as error:
        say({"error": " ".join(str(error).split())})
    return 0


def _end_with_station() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
