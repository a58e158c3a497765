"""Readers of rows see each row once and all of them, also while the files of rows are joined."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from extensions.campaigns import row_files
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.row_files import RowFiles
from extensions.campaigns.shard import Shard
from extensions.campaigns.tests.conftest import COMPILED, rows

READS: dict[str, Callable[[CampaignFolder], Any]] = {
    "done": lambda folder: folder.done().tolist(),
    "count": lambda folder: folder.count(),
    "table": lambda folder: folder.table()["index"].to_pylist(),
    "figures": lambda folder: folder.table(figures_only=True)["index"].to_pylist(),
}
FIVE: dict[str, Any] = {
    "done": [True] * 5,
    "count": 5,
    "table": [*range(5)],
    "figures": [*range(5)],
}


@pytest.fixture
def parts(bench: Any) -> CampaignFolder:
    """Return a campaign, all rows of which are there, in two files."""
    bench.flown(COMPILED, "out", Shard(1, 2))
    folder: CampaignFolder = bench.flown(COMPILED, "other", Shard(2, 2))
    (part,) = folder.rows.iterdir()
    part.rename(bench.folder / "out" / "rows" / part.name)
    return CampaignFolder(bench.folder / "out")


def joined_at(nth: int, folder: CampaignFolder, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Join the files of rows right before the n-th file is opened; return what is opened."""
    opened: list[Path] = []

    def joining(function: Any) -> Any:
        def open_file(part: Any, *words: Any, **options: Any) -> Any:
            opened.append(part)
            if len(opened) == nth:
                opened.append(part)  # what `finish` opens does not count
                folder.finish()
            return function(part, *words, **options)

        return open_file

    for name in ("read_metadata", "read_table", "ParquetFile"):
        monkeypatch.setattr(pq, name, joining(getattr(pq, name)))
    return opened


@pytest.mark.parametrize("can_exchange", [True, False])
@pytest.mark.parametrize("nth", [1, 2])
@pytest.mark.parametrize("name", READS)
def test_rows_are_read_once_and_whole_while_their_files_are_joined(
    name: str, nth: int, can_exchange: bool, parts: CampaignFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not can_exchange:
        monkeypatch.setattr(row_files, "exchange", lambda one, other: False)
    opened = joined_at(nth, CampaignFolder(parts.path), monkeypatch)
    assert READS[name](parts) == FIVE[name]
    assert opened[-1].name == "rows.parquet"
    assert [one.name for one in parts.rows.iterdir()] == ["rows.parquet"]


def test_a_folder_that_is_just_being_renamed_is_waited_for(
    parts: CampaignFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There are two renames on a file system that cannot exchange folders."""
    old = parts.path / "rows.old"
    parts.rows.rename(old)
    monkeypatch.setattr(time, "sleep", lambda _: old.rename(parts.rows))
    assert parts.count() == 5


def test_no_list_of_the_files_is_empty_or_mixed(tmp_path: Path) -> None:
    """Another program lists the files while they are exchanged, many times."""
    files = RowFiles(tmp_path)
    found, is_over = set(), threading.Event()

    def look() -> None:
        while not is_over.is_set():
            try:
                found.add(tuple(os.listdir(files.place)))
            except FileNotFoundError:
                found.add(())

    files.place.mkdir()
    (files.place / "a").touch()
    files.new.mkdir()
    (files.new / "b").touch()
    reader = threading.Thread(target=look)
    reader.start()
    for _ in range(2000):
        assert row_files.exchange(files.new, files.place)
    is_over.set()
    reader.join()
    assert found <= {("a",), ("b",)}


@pytest.mark.parametrize("is_exchanged", [False, True])
def test_a_run_killed_while_it_joins_files_leaves_all_rows(
    is_exchanged: bool, parts: CampaignFolder
) -> None:
    before = rows(parts)
    files = RowFiles(parts.path)
    files.new.mkdir()
    pq.write_table(parts.table(), files.new / "rows.parquet")
    if is_exchanged:
        row_files.exchange(files.new, files.place)
    parts.mend()
    assert rows(parts).equals(before)
    assert not files.new.exists()
