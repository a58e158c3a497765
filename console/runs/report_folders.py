"""The location of a run's report: the folder `runs/<run_id>/report/`.

A run that is a single file has it next to the file, in `runs/<run_id>_report/`.

`result.json` is the verdict; the other files are the experiment's plots and text.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from console.atomic_file import replacing
from quadrotor.errors import StorageError, os_errors

RESULT = "result.json"
FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,119}")


def report_folder(log: Path) -> Path:
    """Return the folder of a run's report; it need not exist."""
    return log / "report" if log.is_dir() else log.with_name(f"{log.stem}_report")


def has_report(log: Path) -> bool:
    return (report_folder(log) / RESULT).is_file()


def read_result(log: Path) -> dict[str, Any]:
    """Return verdict, figures, options and file names. Raises StorageError when there
    is no report.
    """
    path = report_folder(log) / RESULT
    try:
        result: dict[str, object] = json.loads(path.read_text())
    except FileNotFoundError:
        raise StorageError(
            f"run {log.stem} has no report: no experiment was judged on it"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise StorageError(f"the report of run {log.stem} cannot be read: {error}") from None
    return result


def report_file(log: Path, name: str) -> Path:
    """Return a file of the report, never anything outside its folder. Raises StorageError."""
    folder = report_folder(log).resolve()
    path = (folder / name).resolve() if FILE_NAME.fullmatch(name) else folder
    if path.parent != folder or not path.is_file():
        raise StorageError(f"the report of run {log.stem} has no file {name!r:.80}")
    return path


def write_result(log: Path, content: dict[str, object]) -> None:
    """Write the result atomically; the folder must exist. Raises OSError."""
    with replacing(report_folder(log) / RESULT) as path:
        path.write_text(json.dumps(content, indent=1))


def write_decision(log: Path, decision: str, requester: str) -> None:
    """Write the decision about the calibration that the run proposes. Raises StorageError."""
    result = read_result(log)
    with os_errors(lambda why: f"the report of run {log.stem} cannot be written: {why}"):
        write_result(log, result | {"decision": decision, "decided_by": requester})
