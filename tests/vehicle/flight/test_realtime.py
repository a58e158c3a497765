"""Rights granted by the kernel are verified, not assumed."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import pytest

from vehicle import realtime


def test_the_kernel_s_count_of_locked_memory_is_read(tmp_path: Path) -> None:
    status = tmp_path / "status"
    status.write_text("Name:\tpython\nVmLck:\t   1234 kB\nVmPin:\t 0 kB\n")
    assert realtime.locked_kilobytes(status) == 1234
    status.write_text("Name:\tpython\n")
    assert realtime.locked_kilobytes(status) == 0


@pytest.mark.parametrize("kilobytes", [0, 1234])
def test_memory_that_is_not_locked_though_it_was_granted_is_told(
    kilobytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = type("Library", (), {"mlockall": lambda self, flags: 0})()
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: library)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    monkeypatch.setattr(realtime, "locked_kilobytes", lambda: kilobytes)
    granted = realtime.become_real_time()
    assert granted.scheduled
    assert granted.locked == bool(kilobytes)
    assert ("VmLck is 0" in granted.refusal) == (not kilobytes)
