"""Judgements of runs: experiment, verdict and figures of a report, read once a version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.runs.report_folders import RESULT, read_result, report_folder
from quadrotor.errors import StorageError
from quadrotor.json_object import JsonObject

SEARCHED = 500
"""The newest runs among which the last result of an experiment is looked for."""


@dataclass(frozen=True)
class Judged:
    """The judgement of one run.

    Attributes:
        verdict: "unreadable" where the report cannot be read.
        metrics, limits: by name, in SI; None of a metric that is not known.
    """

    experiment: str = ""
    verdict: str = "unreadable"
    metrics: Mapping[str, float | None] = field(default_factory=dict)
    limits: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def rms(self) -> float | None:
        """Return the rms position error in m by which the run was judged, if it was."""
        return self.metrics.get("position_rms_m")

    def as_json(self) -> JsonObject:
        """Return verdict and metrics as the state of an experiment has them."""
        metrics = [
            {"name": name, "value": value, "limit": self.limits.get(name)}
            for name, value in self.metrics.items()
        ]
        return {"verdict": self.verdict, "metrics": metrics}


def judged(log: Path) -> Judged | None:
    """Return the judgement of a run, None without a report."""
    try:
        stamp_ns = (report_folder(log) / RESULT).stat().st_mtime_ns
    except OSError:
        return None
    return _read(log, stamp_ns)


@lru_cache(maxsize=4096)
def _read(log: Path, stamp_ns: int) -> Judged:
    del stamp_ns  # a part of the key: a new judgement is read again
    try:
        result = read_result(log)
    except StorageError:
        return Judged()
    experiment, verdict = str(result.get("experiment", "")), str(result.get("verdict", ""))
    return Judged(experiment, verdict, _numbers(result, "metrics"), _numbers(result, "limits"))


def _numbers(result: JsonObject, name: str) -> dict[str, float | None]:
    given = result.get(name)
    if not isinstance(given, dict):
        return {}
    return {
        str(key): float(value) if isinstance(value, int | float) else None
        for key, value in given.items()
    }


def last_results(catalogue: Catalogue, vehicle: str) -> dict[str, JsonObject]:
    """Return the newest judged run of each experiment: its id, start (s, epoch) and judgement.

    Raises StorageError.
    """
    found: dict[str, JsonObject] = {}
    for entry in catalogue.runs(vehicle=vehicle, limit=SEARCHED):
        of = judged(catalogue.folder / Path(entry.file).name)
        if of is not None and of.experiment not in ("", *found):
            found[of.experiment] = {"run": entry.id, "start": 1e-9 * entry.start_ns, **of.as_json()}
    return found
