"""Files of uPlot, which draws the charts' axes; a browser keeps them by their version."""

from __future__ import annotations

import gzip
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from fastapi import HTTPException
from starlette.requests import Request
from starlette.responses import Response

KEPT = {"cache-control": "private, max-age=31536000, immutable"}
_TYPES = {"uPlot.iife.js": "text/javascript", "uPlot.min.css": "text/css"}
_ADDRESS = re.compile(r'"(/vendor/uPlot[\w.]+)"')


def read_uplot(name: str) -> bytes:
    """Return a file without importing the package, which would import IPython.

    Raises PackageNotFoundError.
    """
    path = distribution("uplot-python").locate_file(f"uplot/static/{name}")
    return Path(str(path)).read_bytes()


def with_version(document: str) -> str:
    """Return a document that names the files by their version."""
    return _ADDRESS.sub(rf'"\1?{_version()}"', document)


def answer(name: str, request: Request) -> Response:
    """Return the response to a browser that asks for one of the files. Raises HTTPException."""
    if name not in _TYPES:
        raise HTTPException(404, f"no {name} here; there are {', '.join(_TYPES)}")
    headers = {"vary": "accept-encoding"}
    if request.url.query == _version():
        headers |= KEPT
    try:
        if "gzip" not in request.headers.get("accept-encoding", ""):
            return Response(read_uplot(name), media_type=_TYPES[name], headers=headers)
        headers["content-encoding"] = "gzip"
        return Response(_packed(name), media_type=_TYPES[name], headers=headers)
    except PackageNotFoundError as error:
        raise HTTPException(500, "uplot-python is not installed; run scripts/setup") from error


@cache
def _version() -> str:
    try:
        return distribution("uplot-python").version
    except PackageNotFoundError:  # the page is shown without its charts, and `answer` tells why
        return "missing"


@cache
def _packed(name: str) -> bytes:
    return gzip.compress(read_uplot(name), 6, mtime=0)
