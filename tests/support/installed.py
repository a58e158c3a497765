"""A package that looks installed: what `importlib.metadata` reads, and files on the path."""

from __future__ import annotations

from pathlib import Path

import pytest


def install(
    monkeypatch: pytest.MonkeyPatch, place: Path, points: dict[str, str], files: dict[str, str]
) -> None:
    """Install the distribution `some-things`.

    Args:
        points: lines of entry points, by group. files: content by name, below `place`.
    """
    facts = place / "some_things-1.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: some-things\nVersion: 1.0\n")
    lines = [f"[{group}]\n{text}\n" for group, text in points.items()]
    (facts / "entry_points.txt").write_text("\n".join(lines))
    for name, content in files.items():
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    monkeypatch.syspath_prepend(place)
