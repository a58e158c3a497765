"""The writer of reports is an extension's; without one, a line says so."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

from console.experiment_running import evaluation
from console.reports import __main__ as program
from console.reports import writer
from quadrotor.extensions import Registry


def test_without_a_writer_a_report_is_refused_in_a_line_and_none_is_begun(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(writer, "registry", lambda: Registry(()))
    monkeypatch.setattr(os, "setpriority", lambda *_: None)
    monkeypatch.setattr(signal, "alarm", lambda _: None)
    assert program.main([str(tmp_path / "run.mcap")]) == 1
    assert capsys.readouterr().out == (
        "no extension of this installation writes reports; install one that does\n"
    )
    monkeypatch.setattr(subprocess, "Popen", None)
    evaluation.begin_report(tmp_path / "run.mcap")
