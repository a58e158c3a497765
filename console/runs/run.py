"""The run before, while and after it is recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from console.runs.title import RunTitle

RESTART_RESERVE = 50_000_000
"""Bytes in addition to those kept free that a run requires after the disk has ended one: minutes of
recording."""


@dataclass(frozen=True)
class Run:
    """One recording; `attachments` is called in the recorder's thread, because it may wait."""

    run_id: str
    path: Path
    metadata: Mapping[str, str]
    start_ns: int = 0  # epoch, of the computer
    attachments: Callable[[], Mapping[str, bytes]] = dict
    keep_free: int = 500_000_000  # bytes
    title: RunTitle = field(default_factory=RunTitle)


@dataclass(frozen=True)
class RunEnd:
    """The end of a run."""

    run: Run
    duration: float  # s
    bytes: int
    messages: int
    dropped: int
    closed: bool  # the file has its index
    problem: str  # why it ended other than as requested, or empty


@dataclass(frozen=True)
class RecorderStatus:
    """The status of the recorder, for the page."""

    recording: bool
    run_id: str
    duration: float  # s
    bytes: int
    free_bytes: int
    dropped: int
    alarms: tuple[str, ...]
