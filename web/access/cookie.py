"""Session cookie: its name and flags."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlsplit

from starlette.responses import Response

from web.access.sessions import SESSION_AGE


class SessionCookie:
    """Session cookie of one page.

    Its name contains the port, because browsers share cookies between the ports of a host. Under
    TLS it is Secure, and its prefix keeps other hosts from setting it.
    """

    def __init__(self, base_url: str) -> None:
        place = urlsplit(base_url)
        secure = place.scheme == "https"
        self.name = f"{'__Host-' if secure else ''}quadlab_{place.port}"
        self._flags: dict[str, Any] = {"secure": secure, "httponly": True, "samesite": "strict"}

    def set(self, answer: Response, value: str) -> None:
        answer.set_cookie(self.name, value, SESSION_AGE, **self._flags)

    def clear(self, answer: Response) -> None:
        answer.delete_cookie(self.name, **self._flags)
