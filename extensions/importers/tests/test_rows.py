"""Rows of large tables, block by block."""

import errno
import os

import numpy as np
import pytest

from extensions.importers import rows
from extensions.importers.rows import Spilled, largest_step, release, steps_where, usual_step
from quadrotor.errors import StorageError


def test_steps_are_found_at_the_edges_of_blocks_too(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(5)
    monkeypatch.setattr(rows, "BLOCK", 4)
    for size in range(2, 14):
        values = random.integers(0, 5, size).astype(float)
        steps = np.diff(values)
        found = steps_where(values, lambda steps: steps < 0.0)
        assert found.tolist() == np.flatnonzero(steps < 0.0).tolist()
        assert steps[largest_step(values)] == steps.max()
        ahead = steps[steps > 0.0]
        assert usual_step(values) == (np.median(ahead) if len(ahead) else 0.0)
    assert steps_where(values[:1], lambda steps: steps == 0.0).tolist() == []


def test_a_table_in_a_file_keeps_its_numbers_when_memory_leaves_them() -> None:
    table = Spilled(2, 100_000)
    table.make_room(0, 100_000)
    table.columns[:] = np.arange(200_000.0).reshape(2, -1)
    part = table.columns[:, 7:90_000].T
    table.close()
    before = part.copy()
    release(part, before)
    assert (part == before).all()


def test_a_full_disk_is_told_by_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    table = Spilled(2, 100)
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(StorageError, match=r"cannot write in .*: No space left on device; TMPDIR"):
        table.make_room(0, 10)
