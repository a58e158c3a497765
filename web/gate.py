"""The gate every HTTP request and websocket passes: right host, own origin, signed in.

A plain ASGI middleware, so that nothing, static files and websockets included, is served before
the checks. A refused websocket is answered 403 before it is accepted.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from web.door import COOKIE_AGE, Door
from web.pages import sign_in_page, signed_in_page

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'self'; base-uri 'none'; form-action 'self'"
)


class Gate:
    """Lets a request through to `app` with its `web.door.Session` in `scope["session"]`.

    Args:
        hosts: allowed values of the Host header (`127.0.0.1:8080`, `localhost:8080`, …).
        cookie: name of the session cookie; it carries the port, for browsers share cookies
            between the ports of one host.
        on_sign_in: told the label of whoever signed in, when a token was consumed.
    """

    def __init__(
        self,
        app: ASGIApp,
        door: Door,
        hosts: frozenset[str],
        cookie: str,
        on_sign_in: Callable[[str], None],
    ) -> None:
        self._app = app
        self._door = door
        self._hosts = hosts
        self._cookie = cookie
        self._on_sign_in = on_sign_in

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        answer = _Answer(scope, send)
        if refusal := self._foreign(scope, headers):
            await answer.error(403, refusal)
            return
        session = self._door.session(self._cookie_of(headers))
        is_entrance = scope["type"] == "http" and scope["path"] == "/"
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token", [None])[0]
        if is_entrance and token is not None and scope["method"] == "GET":
            await self._sign_in(answer, token, signed_in=session is not None)
        elif session is None and (is_entrance or _wants_page(scope, headers)):
            await answer.page(401, sign_in_page(None))
        elif session is None:
            await answer.error(401, "not signed in; open the sign-in link quadlab printed")
        else:
            scope["session"] = session
            await self._app(scope, receive, _with_policy(scope, send))

    def _foreign(self, scope: Scope, headers: dict[str, str]) -> str | None:
        host = headers.get("host", "")
        if host not in self._hosts:
            return f"this is not {host!r}; open http://{min(self._hosts)}/ instead"
        guarded = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        origin = headers.get("origin")
        # Programs send no Origin; browsers always do on a POST, a PUT and a websocket.
        if guarded and origin is not None and urlsplit(origin).netloc != host:
            return f"refused: the request comes from another site ({origin})"
        return None

    def _cookie_of(self, headers: dict[str, str]) -> str | None:
        try:
            morsel = SimpleCookie(headers.get("cookie", "")).get(self._cookie)
        except CookieError:
            return None
        return morsel.value if morsel else None

    async def _sign_in(self, answer: _Answer, token: str, *, signed_in: bool) -> None:
        if signed_in:  # a bookmark or a second click: leave the token to someone else
            await answer.page(200, signed_in_page())
            return
        session = self._door.consume(token)
        if session is None:
            await answer.page(401, sign_in_page("used" if self._door.was_used(token) else "wrong"))
            return
        cookie = (
            f"{self._cookie}={self._door.sign(session)}; Path=/; Max-Age={COOKIE_AGE}; "
            "HttpOnly; SameSite=Strict"
        )
        await answer.page(200, signed_in_page(), cookie)
        self._on_sign_in(session.label)


class _Answer:
    """Replies of the gate itself, for HTTP and for a websocket not yet accepted."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self._scope = scope
        self._send = send

    async def error(self, status: int, line: str) -> None:
        body = json.dumps({"error": line}).encode()
        await self._reply(status, "application/json", body)

    async def page(self, status: int, html: str, cookie: str | None = None) -> None:
        await self._reply(status, "text/html; charset=utf-8", html.encode(), cookie)

    async def _reply(self, status: int, kind: str, body: bytes, cookie: str | None = None) -> None:
        headers = [
            (b"content-type", kind.encode()),
            (b"content-length", str(len(body)).encode()),
            (b"cache-control", b"no-store"),
            (b"referrer-policy", b"no-referrer"),
        ]
        if cookie:
            headers.append((b"set-cookie", cookie.encode()))
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


def _wants_page(scope: Scope, headers: dict[str, str]) -> bool:
    return scope["type"] == "http" and "text/html" in headers.get("accept", "")


def _with_policy(scope: Scope, send: Send) -> Send:
    """Adds the headers every answer carries; an answer may bring its own content policy."""

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = list(message.get("headers", []))
            present = {key.lower() for key, _ in headers}
            headers.append((b"x-content-type-options", b"nosniff"))
            headers.append((b"referrer-policy", b"same-origin"))
            if b"content-security-policy" not in present:
                headers.append((b"content-security-policy", PAGE_POLICY.encode()))
            if b"cache-control" not in present:
                headers.append((b"cache-control", b"no-cache"))
            message = {**message, "headers": headers}
        await send(message)

    return sending if scope["type"] == "http" else send
