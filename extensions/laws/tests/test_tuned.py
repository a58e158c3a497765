"""Settings that campaigns found: the best whole trial, and one budget for all laws."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

from extensions.laws.arena import tuned as module
from extensions.laws.arena.cells import chosen
from extensions.laws.arena.tuned import Found, best_trial, tuned
from quadrotor.errors import UsageError
from quadrotor.extensions import Registry

KP = "control.position.kp_xy"
Flight = tuple[float, str, float | None]


def rows(*flights: Flight) -> pa.Table:
    kp, verdicts, errors = zip(*flights, strict=True)
    return pa.table(
        {
            KP: list(kp),
            "simulator.payload": [0.0] * len(kp),
            "verdict": list(verdicts),
            "position_rms_m": list(errors),
        }
    )


GOOD = (2.0, "passed", 0.04), (2.0, "passed", 0.02)
FELL = (4.0, "passed", 0.01), (4.0, "failed", None)
ENDED = ((6.0, "passed", 0.001),)
WORSE = (8.0, "passed", 0.05), (8.0, "passed", 0.04)


def test_the_best_trial_is_whole_and_none_of_its_flights_fell() -> None:
    assert best_trial(rows(*WORSE, *FELL, *ENDED, *GOOD)) == Found({KP: 2.0}, 4, 2)
    assert best_trial(rows(*FELL, *ENDED)) is None


@pytest.fixture
def campaigns(monkeypatch: pytest.MonkeyPatch) -> dict[str, pa.Table]:
    """Return the rows of campaigns by the name of their folder, to be filled."""
    found: dict[str, pa.Table] = {}

    class Door:
        def load(self) -> object:
            return lambda folder: found[folder.name]

    class Offers(Registry):
        def __init__(self) -> None:
            super().__init__([])

        def offers(self, *_: object, **__: object) -> dict[str, Door]:  # type: ignore[override]
            return {"campaign": Door()}

    monkeypatch.setattr(module, "registry", Offers)
    return found


def test_entries_get_the_best_settings_and_the_budgets_are_told(
    campaigns: dict[str, pa.Table], tmp_path: Path
) -> None:
    for name in ("geometric", "indi"):
        (tmp_path / f"tune_{name}").mkdir()
        campaigns[f"tune_{name}"] = rows(*GOOD, *WORSE)
    entries, budget = tuned(chosen("geometric indi"), tmp_path)
    assert budget == "2 trials of 2 flights"
    assert [one.control().position.kp_xy for one in entries] == [2.0, 2.0]
    campaigns["tune_indi"] = rows(*GOOD)
    _, budget = tuned(chosen("geometric indi"), tmp_path)
    assert budget == "2 trials of 2 flights (geometric); 1 trials of 2 flights (indi)"
    campaigns["tune_indi"] = rows(*FELL)
    with pytest.raises(UsageError, match="tune_indi: no trial passed all its flights; widen"):
        tuned(chosen("indi"), tmp_path)
    with pytest.raises(UsageError, match=r"has no campaign tune_nmpc; fly it: quadlab campaign "):
        tuned(chosen("nmpc"), tmp_path)
