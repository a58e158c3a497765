"""The gate for every HTTP request and websocket: checks host, origin and sign-in.

A plain ASGI middleware, so that nothing, static files and websockets included, is served before
the checks. A refused websocket is answered 403 before it is accepted.
"""

from __future__ import annotations

from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from quadrotor.errors import StorageError
from web.access.accounts import Accounts
from web.access.answer import Answer, Headers
from web.access.cookie import SessionCookie
from web.access.door import Door
from web.access.open_sockets import OpenSockets
from web.access.pages import sign_in_page, signed_in_page
from web.access.roles import Session
from web.access.sign_in import Refusal, SignIn, address_of, read_form
from web.access.signed_links import SignedLinks, with_sharing

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'self'; base-uri 'none'; form-action 'self'"
)


class Gate:
    """Lets a request through to `app` with its `web.access.roles.Session` in `scope["session"]`.

    Args:
        base_url: where we are, with its scheme: pages of another scheme are foreign too.
        hosts: allowed values of the Host header (`127.0.0.1:8080`, `localhost:8080`, …).
        accounts: while there are none, the sign-in page asks for no password.
        links: to single files, which need no session.
    """

    def __init__(
        self,
        app: ASGIApp,
        base_url: str,
        hosts: frozenset[str],
        door: Door,
        cookie: SessionCookie,
        accounts: Accounts,
        sign_in: SignIn,
        sockets: OpenSockets,
        links: SignedLinks,
    ) -> None:
        self._app = app
        self._base_url = base_url
        self._scheme = urlsplit(base_url).scheme
        self._hosts = hosts
        self._door = door
        self._cookie = cookie
        self._accounts = accounts
        self._sign_in = sign_in
        self._sockets = sockets
        self._links = links

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        answer = Answer(scope, send)
        try:
            if refusal := self._foreign(scope, headers):
                await answer.error(403, refusal)
            elif self._links.opens(scope):
                sending = with_sharing(headers, _with_policy(send))
                await self._app(scope, receive, sending)
            elif (allowed := self._links.preflight(scope, headers)) is not None:
                await answer.fields(200, {}, allowed)
            elif not await self._entrance(scope, headers, receive, answer):
                await self._let_in(scope, headers, receive, send, answer)
        except StorageError as error:  # of the accounts: no one is let in
            await answer.error(503, str(error))

    def _foreign(self, scope: Scope, headers: dict[str, str]) -> str | None:
        host = headers.get("host", "").lower()
        if host not in self._hosts:
            return f"this is not {host!r:.80}; open {self._base_url}/ instead"
        guarded = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        origin = headers.get("origin")
        # Programs send no Origin; browsers always do on a POST, a PUT and a websocket.
        if guarded and origin is not None and origin.lower() != f"{self._scheme}://{host}":
            return f"refused: the request comes from another site ({origin:.80})"
        return None

    async def _let_in(
        self, scope: Scope, headers: dict[str, str], receive: Receive, send: Send, answer: Answer
    ) -> None:
        session = self._session(headers)
        if session is None and _wants_page(scope, headers):
            await answer.page(401, self._page("You are not signed in here."))
        elif session is None:
            await answer.error(
                401, "not signed in; open the sign-in link quadlab printed, or sign in at /login"
            )
        elif scope["type"] == "websocket":
            scope["session"] = session
            await self._sockets.serve(self._app, session, scope, receive, send)
        else:
            scope["session"] = session
            await self._app(scope, receive, _with_policy(send))

    async def _entrance(
        self, scope: Scope, headers: dict[str, str], receive: Receive, answer: Answer
    ) -> bool:
        """Answer a request of the sign-in; return whether it was one."""
        if scope["type"] != "http" or scope["path"] not in ("/", "/login"):
            return False
        if scope["path"] == "/login":
            if scope["method"] == "POST":
                await self._by_password(scope, headers, receive, answer)
            elif scope["method"] not in ("GET", "HEAD"):
                await answer.error(405, "sign in with POST", ((b"allow", b"GET, POST"),))
            else:
                await answer.page(200, self._page("Sign in to quadlab."))
            return True
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token", [None])[0]
        if token is None or scope["method"] != "GET":
            return False
        if self._session(headers) is not None:
            # A bookmark or a second click: leave the token to someone else.
            await answer.page(200, signed_in_page())
            return True
        outcome = await self._sign_in.by_link(token, address_of(scope))
        if isinstance(outcome, Refusal):
            await answer.page(outcome.status, self._page(outcome.line))
        else:
            await answer.page(200, signed_in_page(), self._cookie.set(self._door.sign(outcome)))
        return True

    async def _by_password(
        self, scope: Scope, headers: dict[str, str], receive: Receive, answer: Answer
    ) -> None:
        is_page = _wants_page(scope, headers)
        try:
            form = await read_form(receive)
        except ValueError as error:
            await answer.error(400, str(error))
            return
        name = form.get("name", "")
        outcome = await self._sign_in.by_password(name, form.get("password", ""), address_of(scope))
        if isinstance(outcome, Refusal):
            more: Headers = ((b"retry-after", b"%d" % outcome.wait),) if outcome.wait else ()
            if is_page:
                await answer.page(outcome.status, self._page(outcome.line, name), more)
            else:
                await answer.error(outcome.status, outcome.line, more)
            return
        cookie = self._cookie.set(self._door.sign(outcome))
        if is_page:  # the form was ours, so a redirect carries the cookie, and Back works
            await answer.page(303, signed_in_page(), (*cookie, (b"location", b"/")))
        else:
            fields = {"label": outcome.label, "role": outcome.role.value}
            await answer.fields(200, fields, cookie)

    def _session(self, headers: dict[str, str]) -> Session | None:
        try:
            morsel = SimpleCookie(headers.get("cookie", "")).get(self._cookie.name)
        except CookieError:
            return None
        return self._door.session(morsel.value) if morsel else None

    def _page(self, line: str, name: str = "") -> str:
        return sign_in_page(line, name, self._base_url, with_password=self._accounts.count() > 0)


def _wants_page(scope: Scope, headers: dict[str, str]) -> bool:
    return scope["type"] == "http" and "text/html" in headers.get("accept", "")


def _with_policy(send: Send) -> Send:
    """Add the headers every answer carries; an answer may bring its own content policy.

    No Strict-Transport-Security: it would keep a browser from this computer's other ports, and
    from this one once TLS is off again; with a private authority not yet trusted it would forbid
    to go on at all.
    """

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

    return sending
