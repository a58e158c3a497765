"""The session cookie: its name and flags."""

from __future__ import annotations

from urllib.parse import urlsplit

from web.access.answer import Headers
from web.access.sessions import SESSION_AGE


class SessionCookie:
    """The cookie's name contains the port, because browsers share cookies between ports of a host;
    under TLS it is Secure, and its prefix keeps other hosts from setting it."""

    def __init__(self, base_url: str) -> None:
        place = urlsplit(base_url)
        secure = place.scheme == "https"
        self.name = f"{'__Host-' if secure else ''}quadlab_{place.port}"
        self._flags = f"Path=/; HttpOnly; SameSite=Strict{'; Secure' if secure else ''}"

    def set(self, value: str) -> Headers:
        return self._header(f"{self.name}={value}; Max-Age={SESSION_AGE}; {self._flags}")

    def clear(self) -> Headers:
        return self._header(f"{self.name}=; Max-Age=0; {self._flags}")

    def _header(self, text: str) -> Headers:
        return ((b"set-cookie", text.encode("latin-1")),)
