"""Lines of several vehicles on one terminal are marked with their names."""

from __future__ import annotations

import pytest

from vehicle.processes.terminal import _Terminal


def test_a_line_names_the_vehicle_once_it_is_known(capsys: pytest.CaptureFixture[str]) -> None:
    terminal = _Terminal()
    terminal.say("no certificate")
    terminal.speak_for("quad3")
    terminal.say("no sample for 0.5 s")
    assert (
        capsys.readouterr().err == "vehicle: no certificate\nvehicle quad3: no sample for 0.5 s\n"
    )
