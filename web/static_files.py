"""The page's own files, served from memory, and only once to each browser.

Starlette passes each file to other threads, four times; while telemetry keeps the interpreter busy
each hop waits for its turn, and a page has about a hundred files. A document therefore names one
script and one stylesheet, joined from them (`web.joined_files`) and compressed, by the version of
their folder: what a browser has fetched under a version stays in its cache and is not requested
again.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import os
import re
import stat
from pathlib import Path

from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.types import Scope

from web import uplot
from web.joined_files import join_modules, join_styles
from web.theme import html_tag

STATIC = Path(__file__).parent / "static"
PLACE = "/static/"
"""Prefix of the URLs under which the folder is mounted."""
LARGEST = 1_000_000
"""Largest file that is held in memory, in bytes."""
VERSIONED = re.compile(r"v-([0-9a-f]{16})/(.*)", re.DOTALL)
JOINED = "joined/"
"""Folder of the joined scripts (`runs/runs.js`, and its `.map`) and styles (`runs/runs.css`)."""
_STYLES = re.compile(rf'<link rel="stylesheet" href="{PLACE}([^"]+)">\n?')
_SCRIPT = re.compile(rf'<script type="module" src="{PLACE}([^"]+)"></script>')
_JOINED = re.compile(rf"{JOINED}(?:[a-z0-9_]{{1,60}}/)?[a-z0-9_]{{1,60}}(\.css|\.js|\.js\.map)")
_TYPES = {".css": "text/css", ".js": "text/javascript", ".js.map": "application/json"}


class CachedFiles(StaticFiles):
    """Files of a folder, held in memory; a changed one is read again."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory=directory)
        self._folder = directory
        self._kept: dict[str, tuple[int, int, bytes]] = {}
        self._version = ""
        self._joined: dict[str, tuple[str, bytes]] = {}  # by name: version and content
        self._packed: dict[str, tuple[str, bytes]] = {}  # the same, compressed

    def document(self, name: str) -> HTMLResponse:
        """Return a page of the folder, which names the other files by their present version.

        Raises JoinError for files that cannot be joined.
        """
        text = self._read(name)
        self._version = self._versioned()
        if _STYLES.search(text):
            sheet = f"{JOINED}{name.removesuffix('.html')}.css"
            self._join(sheet, self._version)
            first, *others = _STYLES.split(text)[::2]
            link = f'<link rel="stylesheet" href="{PLACE}{sheet}">\n'
            text = first + link + "".join(others)
        if found := _SCRIPT.search(text):
            self._join(f"{JOINED}{found[1]}", self._version)
            text = text.replace(f'src="{PLACE}{found[1]}"', f'src="{PLACE}{JOINED}{found[1]}"')
        text = uplot.with_version(text.replace('<html lang="en">', html_tag(), 1))
        return HTMLResponse(text.replace(f'"{PLACE}', f'"{PLACE}v-{self._version}/'))

    def _read(self, name: str) -> str:
        return (self._folder / name).read_text(encoding="utf-8")

    def _join(self, name: str, version: str) -> bytes:
        """Return a joined file.

        Raises FileNotFoundError for a file that no page of the folder has, or JoinError.
        """
        made, content = self._joined.get(name, ("", b""))
        if made == version:
            return content
        stem = name.removeprefix(JOINED)
        if stem.endswith(".css"):
            sheets = _STYLES.findall(self._read(f"{stem.removesuffix('.css')}.html"))
            self._joined[name] = version, join_styles(sheets, self._read).encode()
        else:
            entry = stem.removesuffix(".map")
            if not any(f'"{PLACE}{entry}"' in one.read_text("utf-8") for one in self._pages()):
                raise FileNotFoundError(entry)
            joined = join_modules(entry, self._read, f"{Path(entry).name}.map", PLACE)
            self._joined[f"{JOINED}{entry}"] = version, joined.text.encode()
            self._joined[f"{JOINED}{entry}.map"] = version, joined.source_map.encode()
        return self._joined[name][1]

    def _pages(self) -> list[Path]:
        return list(self._folder.rglob("*.html"))

    def _versioned(self) -> str:
        files = (Path(of) / name for of, _, names in os.walk(self._folder) for name in names)
        about = [(str(path), path.stat()) for path in files]
        now = sorted((path, found.st_mtime_ns, found.st_size) for path, found in about)
        return hashlib.blake2b(repr(now).encode(), digest_size=8).hexdigest()

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return the file.

        Under a version other than the newest, the present file is returned without permission to
        cache it.
        """
        versioned = VERSIONED.fullmatch(path)
        if versioned is None:
            return await self._current(path, scope)
        response = await self._current(versioned[2], scope)
        if versioned[1] == self._version:
            response.headers.update(uplot.KEPT)
        return response

    async def _current(self, path: str, scope: Scope) -> Response:
        """Serve the file; unusual requests are left to the library."""
        if path.startswith(JOINED):
            return self._current_joined(path, scope)
        found, about = None, None
        with contextlib.suppress(OSError, ValueError):  # the library answers with the error
            found, about = self.lookup_path(path)
        usual = scope["method"] in ("GET", "HEAD") and "range" not in Headers(scope=scope)
        if not usual or not found or about is None or not _is_small_file(about):
            return await super().get_response(path, scope)
        response = self.file_response(found, about, scope)
        if isinstance(response, FileResponse):
            return Response(self._content(found, about), headers=dict(response.headers))
        return response

    def _current_joined(self, path: str, scope: Scope) -> Response:
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(405)
        if (found := _JOINED.fullmatch(path)) is None:
            raise HTTPException(404)
        version = self._versioned()
        headers = {"vary": "accept-encoding"}
        try:
            content = self._join(path, version)
        except FileNotFoundError:
            raise HTTPException(404) from None
        if "gzip" in Headers(scope=scope).get("accept-encoding", ""):
            headers["content-encoding"] = "gzip"
            if self._packed.get(path, ("", b""))[0] != version:
                self._packed[path] = version, gzip.compress(content, 6, mtime=0)
            content = self._packed[path][1]
        return Response(content, media_type=_TYPES[found[1]], headers=headers)

    def _content(self, path: str, about: os.stat_result) -> bytes:
        modified_ns, size, content = self._kept.get(path, (0, -1, b""))
        if (modified_ns, size) != (about.st_mtime_ns, about.st_size):
            content = Path(path).read_bytes()
            self._kept[path] = about.st_mtime_ns, about.st_size, content
        return content


FILES = CachedFiles(STATIC)
"""Static files, shared by the applications of all vehicles."""


def _is_small_file(about: os.stat_result) -> bool:
    return stat.S_ISREG(about.st_mode) and about.st_size <= LARGEST
