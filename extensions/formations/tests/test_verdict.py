"""The verdict on a formation, from the truth in the logs of all vehicles."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from console.evaluation.result import Result
from extensions.formations import report, verdict
from extensions.formations.options import FormationOptions
from extensions.formations.shape import shape_of
from extensions.formations.verdict import CUT, Windows, judge
from flight_log.fields import ATTITUDE, POSITION
from quadrotor.records import Array

COUNT, JOINS = 3, 3
WINDOWS = Windows(2.0, 6.0, 8.0, 8.0)


class _Truth:
    """The truth of one vehicle, which flies from a time on and stands on the ground before."""

    def __init__(self, place: Array, flies: float) -> None:
        self.time = np.arange(0.0, 10.0, 0.05)
        on_ground = np.where(self.time < flies, 0.0, place[2])
        held = zip(POSITION, (place[0], place[1], on_ground), strict=True)
        self._columns = {name: np.broadcast_to(one, self.time.shape) for name, one in held}
        self._columns |= {name: np.zeros_like(self.time) for name in ATTITUDE}
        self._columns[ATTITUDE[0]] = np.ones_like(self.time)

    def values(self, name: str) -> Array:
        return self._columns[name]


@pytest.fixture
def logs(monkeypatch: pytest.MonkeyPatch) -> Mapping[str, Path]:
    """Return three logs of a formation that is held, which the last vehicle joins at 4 s."""
    places = 1.6 * shape_of("", COUNT).places + [0.0, 0.0, 1.2]
    runs = {
        f"quad{k + 1}": SimpleNamespace(
            topics={"truth": _Truth(places[k], 4.0 if k + 1 == JOINS else 0.0)}
        )
        for k in range(COUNT)
    }
    monkeypatch.setattr(verdict, "read_run", lambda log: runs[log.stem])
    return {name: Path(f"{name}.mcap") for name in runs}


def test_one_whose_link_is_cut_on_purpose_is_left_out(logs: Mapping[str, Path]) -> None:
    for figures, judged in (({}, "failed"), ({CUT: 3.0}, "passed")):
        results = {name: Result("passed", {}, {}) for name in logs}
        results[f"quad{JOINS}"] = Result("passed", figures, {})
        result = judge(FormationOptions(), shape_of("", COUNT), WINDOWS, logs, results)
        assert result.verdict == judged, "it stands on the ground at first"


@pytest.mark.parametrize(
    ("joins", "outside", "judged"), [(JOINS, 0.0, "passed"), (0, 0.2, "failed")]
)
def test_one_that_joins_may_stand_on_the_ground_until_the_formation_is_held(
    logs: Mapping[str, Path], joins: int, outside: float, judged: str
) -> None:
    options = FormationOptions(joins=joins)
    results = {name: Result("passed", {"eigenvalue_min": 0.5}, {}) for name in logs}
    result = judge(options, shape_of("", COUNT), WINDOWS, logs, results)
    assert result.metrics["outside_volume_m"] == pytest.approx(outside)
    assert result.metrics["steady_bearing_rms_deg"] == pytest.approx(0.0, abs=1e-6)
    assert result.metrics["converged_s"] == pytest.approx(2.0, abs=0.1)
    assert "places_rms_cm" not in result.metrics, "nobody has estimated any"
    assert result.verdict == judged


def test_the_report_draws_those_that_are_judged_and_lists_the_figures(
    logs: Mapping[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "read_run", vars(verdict)["read_run"])
    results = {name: Result("passed", {}, {}) for name in logs}
    results[f"quad{JOINS}"] = Result("failed", {}, {}, "it fell")
    options, shape = FormationOptions(), shape_of("", COUNT)
    joint = judge(options, shape, WINDOWS, logs, results)
    picture, text = report.write(
        options, shape, WINDOWS, logs, results, joint=joint, folder=tmp_path
    )
    assert picture.read_bytes().startswith(b"\x89PNG")
    lines = text.read_text().splitlines()
    assert "Verdict: **failed**" in lines
    assert {"- quad1: passed", f"- quad{JOINS}: failed"} <= set(lines)
    assert any(line.startswith("| separation_lack_m | 0 | 0 |") for line in lines)
