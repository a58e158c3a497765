"""Formats, recognised by the first bytes of their files."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from extensions.importers.tables import Source
from extensions.importers.text_table import TextTable
from quadrotor.errors import LogFormatError, StorageError, os_errors
from quadrotor.extension import Importer
from quadrotor.extensions import registry

BAG, TEXT = "rosbag", "csv"


def format_of(path: Path) -> str:
    """Return the format of a file or folder. Raises LogFormatError or StorageError."""
    with os_errors(lambda why: f"cannot read {path}: {why}"):
        if not path.exists():
            raise StorageError(f"{path} is not a file")
        if (path / "metadata.yaml").is_file():
            return BAG
        if path.is_dir():
            raise LogFormatError(f"{path} is a folder; give one file of it")
        with path.open("rb") as file:
            head = file.read(4096)
    if not head:
        raise LogFormatError(f"{path.name} is empty")
    known = registry().offers(Importer, taken=(TEXT,))
    found = next((n for n, one in known.items() if head.startswith(one.offer.starts)), None)
    if found is None and b"\0" in head:
        raise LogFormatError(
            f"{path.name} has an unknown format; known are {', '.join((*known, TEXT))}"
        )
    return found or TEXT


def open_source(path: Path, wanted: Collection[str]) -> Source:
    """Open a file; if it has many tables, only those `wanted` are read. Raises as `format_of`."""
    found = format_of(path)
    if found == TEXT:
        return TextTable(path)
    source: Source = registry().offers(Importer)[found].load()(path, wanted)
    return source
