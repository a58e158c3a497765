"""Replies of the gate itself, for HTTP and for a websocket not yet accepted."""

from __future__ import annotations

import json

from starlette.types import Scope, Send

Headers = tuple[tuple[bytes, bytes], ...]
POLICY = (
    b"default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; "
    b"frame-ancestors 'none'; base-uri 'none'"
)


class Answer:
    """One reply, as a line with an error, as JSON fields or as a page."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self._scope = scope
        self._send = send

    async def error(self, status: int, line: str, headers: Headers = ()) -> None:
        await self.fields(status, {"error": line}, headers)

    async def fields(self, status: int, fields: dict[str, str], headers: Headers = ()) -> None:
        body = json.dumps(fields).encode()
        await self._reply(status, b"application/json", body, headers)

    async def page(self, status: int, html: str, headers: Headers = ()) -> None:
        headers = ((b"content-security-policy", POLICY), *headers)
        await self._reply(status, b"text/html; charset=utf-8", html.encode(), headers)

    async def _reply(self, status: int, kind: bytes, body: bytes, more: Headers) -> None:
        headers = [
            (b"content-type", kind),
            (b"content-length", str(len(body)).encode()),
            (b"cache-control", b"no-store"),
            # Not `no-referrer`: under it a browser sends a form with `Origin: null`.
            (b"referrer-policy", b"same-origin"),
            (b"x-content-type-options", b"nosniff"),
            *more,
        ]
        prefix = ""
        if self._scope["type"] == "websocket":
            if "websocket.http.response" not in self._scope.get("extensions", {}):
                await self._send({"type": "websocket.close", "code": 1008})
                return
            prefix = "websocket."
        elif self._scope["method"] == "HEAD":
            body = b""
        start = {"type": f"{prefix}http.response.start", "status": status, "headers": headers}
        await self._send(start)
        await self._send({"type": f"{prefix}http.response.body", "body": body})
