"""The explanation of a flight in its report, as on the replay page and the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from console.evaluation.findings import explain_log
from extensions.replay.build import build_replay
from extensions.replay.reader import Replay
from extensions.reports.report import write_report
from quadlab.__main__ import main


def test_a_flight_with_a_weak_motor_explains_itself_in_report_and_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = tmp_path / "runs"
    main(["fly", "hover", "--set", "simulator.motor_gain_left=0.85", "--out", str(runs)])
    [log] = runs.glob("*.mcap")
    first = explain_log(log)[0]
    assert (first.kind, first.claim.split()[1]) == ("motor_weak", "left")
    [page] = write_report(log, tmp_path / "report", pdf=False)
    text = page.read_text()
    assert first.claim in text
    assert f'href="/replay/{log.stem}#t={first.start:.3f}&amp;w=10&amp;s=thrust.front' in text
    build_replay(log, lambda share: None)
    [told, *_] = Replay(log).described()["findings"]
    assert told == first.as_json()
    capsys.readouterr()
    main(["log", "info", "--explain", str(log)])
    assert first.claim in capsys.readouterr().out
    main(["log", "info", "--json", "--explain", str(log)])
    assert json.loads(capsys.readouterr().out)["findings"][0] == first.as_json()
