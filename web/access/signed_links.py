"""Links to one run's file that work without a session, for ten minutes.

Foxglove and Lichtblick read a log from their own pages, which do not send this page's cookie. So a
link carries a signature over run and time instead: it allows reading that file, and nothing else.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import os
import re
import secrets
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import parse_qs, urlencode

from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Scope

from quadrotor.errors import StorageError

AGE = 600  # s
FOLDER = "/signed/runs/"
SUFFIX = ".mcap"  # by which viewers recognise the format
KEY = "links.key"
METHODS = frozenset({"GET", "HEAD", "OPTIONS"})  # a browser sends the last before it reads
SITES = frozenset({"https://app.foxglove.dev", "https://lichtblick-suite.github.io"})
"""Sites whose pages may read the file, in addition to those served by the reader's computer."""

_OWN = r"http://(localhost|127\.0\.0\.1|\[::1\])(:\d{1,5})?"
_RUN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,119}")
_READ = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag", "Last-Modified")


class SignedLinks:
    """Maker and verifier of signed links.

    Args:
        folder: `<data>/web`; the key is stored there, mode 0600.
        clock: s, epoch.

    Raises StorageError when the key cannot be read or made.
    """

    def __init__(self, folder: Path, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._key = _key(folder / KEY)

    def make(self, run_id: str) -> str:
        """Return path and query of a link to the run's file.

        Raises StorageError if the run's name has other characters than a link allows.
        """
        if not _RUN.fullmatch(run_id):
            raise StorageError(f"run {run_id!r:.80}: a file of this name has no link")
        expires = int(self._clock()) + AGE
        query = urlencode({"expires": expires, "signature": self._sign(run_id, str(expires))})
        return f"{FOLDER}{run_id}{SUFFIX}?{query}"

    def opens(self, scope: Scope) -> bool:
        """Return whether this request carries a valid signature for exactly what it requests."""
        path = scope["path"]
        if scope["type"] != "http" or scope["method"] not in METHODS:
            return False
        run_id = path.removeprefix(FOLDER).removesuffix(SUFFIX)
        if path != f"{FOLDER}{run_id}{SUFFIX}" or not _RUN.fullmatch(run_id):
            return False
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        given, until = query.get("signature", []), query.get("expires", [])
        if query.keys() != {"signature", "expires"} or len(given) != 1 or len(until) != 1:
            return False
        right = self._sign(run_id, until[0])
        if not hmac.compare_digest(right.encode(), given[0].encode()):
            return False
        return self._clock() <= int(until[0])  # a number, because the signature is right

    @staticmethod
    def sharing(app: ASGIApp) -> ASGIApp:
        """Return `app` with the headers that let the pages of SITES read its answers."""
        return CORSMiddleware(
            app,
            allow_origins=SITES,
            allow_origin_regex=_OWN,
            allow_methods=("GET", "HEAD"),
            allow_headers=("Range",),
            allow_private_network=True,
            expose_headers=_READ,
            max_age=AGE,
        )

    def _sign(self, run_id: str, expires: str) -> str:
        signed = hmac.digest(self._key, f"run\n{run_id}\n{expires}".encode(), hashlib.sha256)
        return base64.urlsafe_b64encode(signed).rstrip(b"=").decode()


def _key(path: Path) -> bytes:
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except FileExistsError:
            path.chmod(0o600)
            key = path.read_bytes()
        else:
            key = secrets.token_bytes(32)
            with os.fdopen(descriptor, "wb") as file:
                file.write(key)
    except OSError as error:
        raise StorageError(
            f"cannot use {path} ({error.strerror}); check the data folder's owner"
        ) from error
    if len(key) < 32:
        raise StorageError(f"{path} is damaged; delete it, and links made before stop working")
    return key
