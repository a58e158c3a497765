"""Run commands on logs in this process and report status and peak memory of each.

Each line of the standard input is JSON [command, log, folder]; each answer is a line of JSON.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import os
import shutil
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

from quadlab.__main__ import main
from quadrotor.errors import QuadlabError


def _command(*words: str, out: bool = False, of_copy: bool = False) -> Callable[[Path, Path], int]:
    def run(log: Path, folder: Path) -> int:
        if of_copy:
            log = Path(shutil.copy(log, folder))
        return main([*words, str(log), *(["--out", str(folder / "out")] if out else [])])

    return run


def _page(log: Path, folder: Path) -> int:
    """Do what *Runs* does with a log: enter it, list it, prepare it for replay, read it."""
    from console.catalogue.catalogue import Catalogue
    from console.runs.adoption import tidy_runs
    from extensions.replay.build import build_replay
    from extensions.replay.reader import Replay
    from web.runs.listing import lines

    catalogue = Catalogue(folder)
    copy = Path(shutil.copy(log, folder / "runs" / "20260101T000000Z_q.mcap"))
    try:
        tidy_runs(catalogue)
        assert len(lines(catalogue, catalogue.runs())) == 1
        build_replay(copy, lambda share: None)
        replay = Replay(copy)
        described = replay.described()
        names = [one["name"] for one in described["signals"]][:8]
        if names:
            replay.window(names, 0.0, described["duration"], 500)
            replay.at(names, 0.0)
    except QuadlabError as error:
        print(error, file=sys.stderr)
        return 1
    finally:
        catalogue.close()
    return 0


COMMANDS: dict[str, Callable[[Path, Path], int]] = {
    "info": _command("log", "info"),
    "check": _command("log", "check"),
    "export csv": _command("log", "export", out=True),
    "export parquet": _command("log", "export", "--format", "parquet", out=True),
    "export mat": _command("log", "export", "--format", "mat", out=True),
    "recover": _command("log", "recover", of_copy=True),
    "report": _command("log", "report", out=True),
    "replay": _command("replay"),
    "page": _page,
}


def _megabytes(name: str) -> float:
    """Return MB from this process's status: VmHWM, the peak since its reset, or VmRSS."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(f"{name}:"):
            return float(line.split()[1]) * 1024e-6
    raise OSError(f"no {name} in /proc/self/status")


def work() -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # the output of libraries is not an answer
    for line in sys.stdin:
        command, log, out = json.loads(line)
        folder = Path(out)
        folder.mkdir()
        gc.collect()
        Path("/proc/self/clear_refs").write_text("5")  # reset the peak
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                status = COMMANDS[command](Path(log), folder)
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else 1
            except BaseException:
                said.write(traceback.format_exc())
                status = -1
        told = said.getvalue()
        if "Traceback" in told:
            status = -1
        peak = _megabytes("VmHWM")
        gc.collect()
        answer = {"status": status, "peak": peak, "rest": _megabytes("VmRSS"), "said": told[-2000:]}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    work()
