"""The result of an experiment: its verdict, figures and limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

PASSED, FAILED, NOT_JUDGED = "passed", "failed", "not_judged"
VERDICTS = (PASSED, FAILED, NOT_JUDGED)


@dataclass(slots=True)
class Result:
    """The result of an experiment; `console.evaluation.verdict.judged` creates it from the figures.

    Attributes:
        verdict: "passed", "failed" or "not_judged".
        metrics: figures by name, SI units.
        limits: the largest acceptable values.
        reason: why it is not judged; empty otherwise.
    """

    verdict: str
    metrics: dict[str, float]
    limits: dict[str, float] = field(default_factory=dict)
    reason: str = ""


class Evaluable(Protocol):
    """An experiment as far as its evaluation goes."""

    name: str

    def evaluate(self, log: Path) -> Result: ...
