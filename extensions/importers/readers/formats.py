"""Formats, recognised by the first bytes of their files."""

from __future__ import annotations

import codecs
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from extensions.importers.readers.joined import JoinedTables
from extensions.importers.readers.packed import (
    GZIP,
    UNPACKED,
    ZSTD,
    first_bytes,
    is_packed,
    unpacked,
)
from extensions.importers.readers.progress import each, part
from extensions.importers.readers.tables import Source
from extensions.importers.readers.text_table import TextTable
from flight_log.run_folder import STATION
from quadrotor.errors import LogFormatError, StorageError, os_errors
from quadrotor.extension import Importer
from quadrotor.extensions import registry

BAG, TEXT = "rosbag", "csv"
HEAD = 4096
"""Number of bytes by which a format is recognised."""
UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
INSTEAD = (
    (b"PK\x03\x04", "an archive or a workbook: unpack it, or save its sheet as CSV"),
    ((b"BZh", b"\xfd7zXZ\0", b"7z\xbc\xaf", b"Rar!", GZIP, ZSTD), "packed: unpack it first"),
    (b"ARROW1", "of Arrow or Feather: write it as Parquet or CSV"),
    (b"version https://git-lfs.", "the place of a file in Git LFS: fetch it by `git lfs pull`"),
    ((b"<!DOCTYPE", b"<!doctype", b"<html"), "a page of the web, perhaps of a failed download"),
    (b"%PDF-", "a document"),
    ((b"{", b"["), "JSON: write it as CSV or Parquet, pandas does with read_json"),
)
"""Beginnings of files that people take for a log, and what to try."""
SHOWN = 6
"""Largest number of files listed in a message."""


def format_of(path: Path) -> str:
    """Return the format of a file or folder. Raises LogFormatError or StorageError."""
    with os_errors(lambda why: f"cannot read {path}: {why}"):
        if not path.exists():
            raise StorageError(f"{path} is not a file")
        if (path / "metadata.yaml").is_file():
            return BAG
        if path.is_dir():
            raise _folder_error(path)
        if not path.is_file():  # a pipe or a device may never end
            raise LogFormatError(f"{path} is no regular file: write what it has into one")
        with path.open("rb") as file:
            head = file.read(HEAD)
    if is_packed(head):
        head = first_bytes(path, HEAD)
    if not head:
        raise LogFormatError(f"{path.name} is empty")
    known = registry().offers(Importer, taken=(TEXT,))
    found = next((n for n, one in known.items() if head.startswith(one.offer.starts)), None)
    if found is None:
        found = next((n for n, one in known.items() if _begins(head, one.offer.pattern)), None)
    if found is None and (hint := next((h for start, h in INSTEAD if head.startswith(start)), "")):
        raise LogFormatError(f"{path.name} is no recorded flight: it is {hint}")
    if found is None and head[257:262] == b"ustar":
        raise LogFormatError(f"{path.name} is an archive: unpack it, and give one file of it")
    if found is None and b"\0" in head and not head.startswith(UTF16):
        raise LogFormatError(
            f"{path.name} has an unknown format; known are {', '.join((*known, TEXT))}"
        )
    return found or TEXT


def _begins(head: bytes, pattern: bytes) -> bool:
    return bool(pattern) and re.match(pattern, head, re.DOTALL) is not None


def _is_packed(path: Path) -> bool:
    if path.is_dir():
        return False
    with path.open("rb") as file:
        return is_packed(file.read(HEAD))


def _folder_error(path: Path) -> LogFormatError:
    """Return why a folder is not imported, with what to try instead."""
    if (path / STATION).is_file():
        return LogFormatError(
            f"{path} is a run of quadlab already: copy the folder to runs/ in the data folder, "
            "where the page shows it"
        )
    files = sorted(one.name for one in path.iterdir() if one.is_file())
    bags = [one for one in files if one.endswith((".mcap", ".mcap.zstd", ".bag"))]
    named = bags or files
    more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
    listed = f"; it has {', '.join(named[:SHOWN])}{more}" if named else ", and it has none"
    return LogFormatError(f"{path} is a folder: give one file of it, or those of a flight{listed}")


@contextmanager
def source_of(path: Path, wanted: Collection[str]) -> Iterator[Source]:
    """Yield a file's tables; if there are many, only those `wanted` are read. Raises as
    `format_of`.
    """
    if not _is_packed(path):
        yield open_source(path, wanted)
        return
    with unpacked(path) as (found, torn):
        with part(UNPACKED, 1.0):
            source = open_source(found, wanted)
        source.torn = torn or source.torn
        yield source


def open_source(path: Path, wanted: Collection[str]) -> Source:
    """Open a file; if it has many tables, only those `wanted` are read. Raises as `format_of`."""
    found = format_of(path)
    if found == TEXT:
        return TextTable(path)
    if found == BAG and (parts := _mcap_parts(path)):
        # Other than the bag's reader, that of MCAP passes over what it cannot decode.
        joined = JoinedTables([open_source(one, wanted) for one in each(parts)])
        if missing := _missing_parts(path):
            joined.notes.append(
                f"{path.name}: its metadata.yaml names {', '.join(missing)}, missing"
            )
        return joined
    source: Source = registry().offers(Importer)[found].load()(path, wanted)
    return source


def _mcap_parts(bag: Path) -> list[Path]:
    """Return the files of a folder that is a bag of plain MCAP files; none for other bags."""
    if not bag.is_dir() or any(bag.glob("*.zst*")):
        return []
    is_packed_inside = re.search(r"compression_mode:\s*['\"]?[A-Za-z]", _described(bag))
    return [] if is_packed_inside else sorted(bag.glob("*.mcap"))


def _missing_parts(bag: Path) -> list[str]:
    """Return the files that the description of a bag names and its folder does not have."""
    named = re.findall(
        r"^\s*(?:-|path:)\s+['\"]?([^'\"\n]+\.mcap)\b", _described(bag), re.MULTILINE
    )
    return [one for one in dict.fromkeys(named) if not (bag / one).exists()]


def _described(bag: Path) -> str:
    return (bag / "metadata.yaml").read_text(encoding="utf-8", errors="replace")
