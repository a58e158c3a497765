"""The revision of the sources, as each log has it."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from flight_log import provenance


@pytest.mark.parametrize(
    ("status", "is_dirty"), [("", "false"), (" M a.py\n", "true"), (None, "unknown")]
)
def test_sources_are_not_called_unchanged_when_git_takes_too_long(
    status: str | None, is_dirty: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands: list[list[str]] = []

    def run(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        commands.append(command)
        if "status" not in command:
            return subprocess.CompletedProcess(command, 0, "abc\n")
        if status is None:
            raise subprocess.TimeoutExpired(command, options["timeout"])
        return subprocess.CompletedProcess(command, 0, status)

    monkeypatch.setattr(provenance, "PREFIX", "")
    monkeypatch.setattr(subprocess, "run", run)
    assert provenance.revision() == {"git_revision": "abc", "git_dirty": is_dirty}
    assert all("--no-optional-locks" in one for one in commands)  # a killed one leaves no lock
