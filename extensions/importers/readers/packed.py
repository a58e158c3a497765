"""Files compressed as a whole (`flight.csv.gz`, `flight.mcap.zstd`), unpacked beside the rest."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from extensions.importers.readers.progress import tell
from extensions.importers.working_folder import working_folder
from flight_log.limits import MAX_UNPACKED
from quadrotor.errors import LogFormatError, os_errors

if TYPE_CHECKING:
    from zstandard import ZstdDecompressionObj

GZIP, ZSTD = b"\x1f\x8b", b"\x28\xb5\x2f\xfd"
UNPACKED = 0.5
"""Share of the reading after which a file is unpacked."""
ZSTD_PIECE, GZIP_PIECE = 1 << 10, 1 << 14
"""Bytes unpacked at once: four of zstd can be 128 kB, one of gzip 1 kB."""


def is_packed(head: bytes) -> bool:
    """Return whether a file that begins so is compressed as a whole."""
    return head.startswith((GZIP, ZSTD))


def first_bytes(path: Path, count: int) -> bytes:
    """Return the first bytes of the unpacked file. Raises LogFormatError or StorageError."""
    found = b""
    try:
        for piece in _pieces(path):
            found += piece
            if len(found) >= count:
                break
    except EOFError as error:
        if not found:
            raise LogFormatError(f"{path.name} cannot be unpacked: {error!s:.120}") from error
    return found[:count]


@contextmanager
def unpacked(path: Path) -> Iterator[tuple[Path, str]]:
    """Yield the unpacked file, which is removed in the end, and why it is incomplete; empty if it
    is whole. Raises LogFormatError or StorageError.
    """
    with working_folder(Path(tempfile.gettempdir()), "quadlab-import-") as folder:
        found, size, torn = folder / path.stem, 0, ""
        with found.open("wb") as target:
            try:
                for piece in _pieces(path):
                    size += len(piece)
                    if size > MAX_UNPACKED:
                        raise LogFormatError(
                            f"{path.name} opens to more than {MAX_UNPACKED / 1e9:.0f} GB; so much "
                            "is not imported: unpack it, and cut it into flights"
                        )
                    with os_errors(lambda why: f"cannot unpack {path} into {folder}: {why}"):
                        target.write(piece)
            except EOFError:
                torn = f"{path.name} ends within a compressed frame"
        yield found, torn


def _pieces(path: Path) -> Iterator[bytes]:
    """Yield the unpacked bytes, with at most some ten megabytes at once.

    Raises EOFError at the end of a file that is cut off, LogFormatError or StorageError.
    """
    from zstandard import ZstdError

    with os_errors(lambda why: f"cannot read {path}: {why}"), path.open("rb") as packed:
        is_gzip = packed.peek(len(GZIP)).startswith(GZIP)
        size = path.stat().st_size
        frame = _begun(is_gzip=is_gzip)
        try:
            while data := packed.read(GZIP_PIECE if is_gzip else ZSTD_PIECE):
                tell(UNPACKED * packed.tell() / size)
                while data:
                    if frame.eof:  # gzip is filled up by zeros to the blocks of a tape
                        data = data.lstrip(b"\0") if is_gzip else data
                        frame = _begun(is_gzip=is_gzip) if data else frame
                    if data:
                        yield frame.decompress(data)
                    data = frame.unused_data if frame.eof else b""
        except (ZstdError, zlib.error) as error:
            raise LogFormatError(f"{path.name} cannot be unpacked: {error!s:.120}") from error
        if not frame.eof:
            raise EOFError("the file ends early, within a frame")


def _begun(*, is_gzip: bool) -> zlib._Decompress | ZstdDecompressionObj:
    """Return what unpacks one frame, and is told of its end."""
    from zstandard import ZstdDecompressor

    if is_gzip:
        return zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
    return ZstdDecompressor().decompressobj()
