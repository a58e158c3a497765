"""Links to one run's file that work without a session, for ten minutes.

Foxglove and Lichtblick read a log from their own pages, which do not send this page's cookie. So a
link carries a signature over run and time instead: it allows reading that file, and nothing else.
"""

from __future__ import annotations

import re
from urllib.parse import parse_qs, urlencode

from itsdangerous import BadSignature
from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Scope

from quadrotor.errors import StorageError
from web.access.steady_time import SteadySigner

AGE = 600  # s
FOLDER = "/signed/runs/"
SUFFIX = ".mcap"  # by which viewers recognise the format
METHODS = frozenset({"GET", "HEAD", "OPTIONS"})  # a browser sends the last before it reads
SITES = frozenset({"https://app.foxglove.dev", "https://lichtblick-suite.github.io"})
"""Sites whose pages may read the file, in addition to those served by the reader's computer."""

_OWN = r"http://(localhost|127\.0\.0\.1|\[::1\])(:\d{1,5})?"
_RUN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,119}")
_READ = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag", "Last-Modified")


class SignedLinks:
    """Maker and verifier of signed links; `secret` is that of the data folder."""

    def __init__(self, secret: str) -> None:
        self._signer = SteadySigner(secret, salt="quadlab-run-link")

    def make(self, run_id: str) -> str:
        """Return path and query of a link to the run's file.

        Raises StorageError if the run's name has other characters than a link allows.
        """
        if not _RUN.fullmatch(run_id):
            raise StorageError(f"run {run_id!r:.80}: a file of this name has no link")
        signature = self._signer.sign(run_id).decode().removeprefix(f"{run_id}.")
        return f"{FOLDER}{run_id}{SUFFIX}?{urlencode({'signature': signature})}"

    def opens(self, scope: Scope) -> bool:
        """Return whether this request carries a valid signature for exactly what it requests."""
        path = scope["path"]
        if scope["type"] != "http" or scope["method"] not in METHODS:
            return False
        run_id = path.removeprefix(FOLDER).removesuffix(SUFFIX)
        if path != f"{FOLDER}{run_id}{SUFFIX}" or not _RUN.fullmatch(run_id):
            return False
        match parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True):
            case {"signature": [signature], **others} if not others:
                try:
                    self._signer.unsign(f"{run_id}.{signature}", max_age=AGE)
                except BadSignature:
                    return False
                return True
        return False

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
