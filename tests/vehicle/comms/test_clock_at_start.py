"""A vehicle whose computer starts in 1970, because nothing keeps its clock while it is off."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from vehicle.comms.start_certificates import certificates_in_time
from vehicle_link.security import authority


class Waiting:
    """The end of the process, not asked for; the clock is set at the third look."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, is_ended: bool = False) -> None:
        self._monkeypatch, self._is_ended, self.looks = monkeypatch, is_ended, 0
        self._set(datetime.timedelta(days=1))

    def _set(self, ahead: datetime.timedelta) -> None:
        earliest = datetime.datetime.now(datetime.UTC) + ahead
        self._monkeypatch.setattr(authority, "EARLIEST", earliest)

    def wait(self, timeout: float) -> bool:
        self.looks += 1
        if self.looks == 3:
            self._set(-datetime.timedelta(days=1))
        return self._is_ended


def test_it_connects_once_the_clock_is_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    waiting = Waiting(monkeypatch)
    files = certificates_in_time(tmp_path / "certificates", waiting)
    assert files is not None
    assert files.authority.exists()
    assert waiting.looks == 3
    said = capfd.readouterr().err
    assert said.count("set the clock; until then no base is connected and nothing flies") == 1


def test_it_ends_when_asked_while_the_clock_is_not_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert certificates_in_time(tmp_path / "certificates", Waiting(monkeypatch, True)) is None
    assert not (tmp_path / "certificates").exists()
