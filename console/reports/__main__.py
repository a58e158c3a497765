"""`python -m console.reports [--no-pdf] LOG [OUT]` writes a run's report, at low priority.

Without OUT it is written next to the run's result. Prints the progress in lines; after a failure
the last line is the reason and the exit status is 1.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

from console.reports.writer import report_writer
from console.runs.report_folders import report_folder
from quadrotor.errors import QuadlabError

NICENESS = 15
LONGEST = 600
"""Longest run time in s, in case the parent process has ended."""


def main(words: list[str]) -> int:
    pdf = "--no-pdf" not in words
    words = [word for word in words if word != "--no-pdf"]
    if len(words) not in (1, 2):
        print("python -m console.reports [--no-pdf] LOG [OUT]")
        return 2
    log = Path(words[0])
    os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    signal.alarm(LONGEST)
    try:
        folder = Path(words[1]) if len(words) == 2 else report_folder(log)
        write = report_writer()
        write(log, folder, pdf=pdf, progress=lambda share: print(f"{share:.2f}", flush=True))
    except QuadlabError as error:
        print(" ".join(str(error).split()))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
