"""The page's own files, served from memory.

Starlette hands each file to other threads, four times; while telemetry keeps the interpreter busy
each hop waits for its turn, and a page is about a hundred files.
"""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.types import Scope

LARGEST = 1_000_000
"""Bytes of a file that is kept."""


class KeptFiles(StaticFiles):
    """Files of a folder; a changed one is read again."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory=directory)
        self._kept: dict[str, tuple[int, int, bytes]] = {}

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Anything unusual is left to the library."""
        found, about = None, None
        with contextlib.suppress(OSError, ValueError):  # the library makes an answer of it
            found, about = self.lookup_path(path)
        usual = scope["method"] in ("GET", "HEAD") and "range" not in Headers(scope=scope)
        if not usual or not found or about is None or not _is_small_file(about):
            return await super().get_response(path, scope)
        response = self.file_response(found, about, scope)
        if isinstance(response, FileResponse):
            return Response(self._content(found, about), headers=dict(response.headers))
        return response

    def _content(self, path: str, about: os.stat_result) -> bytes:
        modified_ns, size, content = self._kept.get(path, (0, -1, b""))
        if (modified_ns, size) != (about.st_mtime_ns, about.st_size):
            content = Path(path).read_bytes()
            self._kept[path] = about.st_mtime_ns, about.st_size, content
        return content


def _is_small_file(about: os.stat_result) -> bool:
    return stat.S_ISREG(about.st_mode) and about.st_size <= LARGEST
