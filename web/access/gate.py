"""Gate for every HTTP request and websocket, which checks host, origin and sign-in.

It is a plain ASGI middleware, so that nothing, not even a static file or a websocket, is served
before the checks. A refused websocket gets 403 before it is accepted.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from quadrotor.errors import StorageError
from web.access.pages import link_page, page_response, replace_page, sign_in_page, signed_in_page
from web.access.people import People
from web.access.roles import Session
from web.access.sign_in import Refusal, address_of, read_form
from web.access.signed_links import SignedLinks
from web.body import refused_size
from web.theme import follow_choice

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'self'; base-uri 'none'; form-action 'self'"
)
OURS = "same-origin"
"""The value of a browser's Sec-Fetch-Site header for requests of our own pages."""
NO_STORE = {"cache-control": "no-store"}


class Gate:
    """ASGI middleware that passes signed-in requests to `app`.

    The application finds the `web.access.roles.Session` in `scope["session"]`.

    Args:
        base_url: the address of this page with its scheme; pages of another scheme are foreign too.
        hosts: allowed values of the Host header (`127.0.0.1:8080`, `localhost:8080`, …).
        people: the users; while they have no accounts, the sign-in page asks for no password.
        links: signed links to single files, which need no session.
    """

    def __init__(
        self, app: ASGIApp, base_url: str, hosts: frozenset[str], people: People, links: SignedLinks
    ) -> None:
        self._app = app
        self._shared = links.sharing(app)
        self._base_url = base_url
        self._scheme = urlsplit(base_url).scheme
        self._hosts = hosts
        self._people = people
        self._links = links

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        send = _with_policy(send)
        try:
            app = await self._application(scope, receive)
            if "session" in scope and scope["type"] == "websocket":
                await self._people.sockets.serve(app, scope["session"], scope, receive, send)
            else:
                await app(scope, receive, send)
        except StorageError as error:  # the accounts cannot be read: refuse everyone
            await _error(503, str(error))(scope, receive, send)

    async def _application(self, scope: Scope, receive: Receive) -> ASGIApp:
        """Return the ASGI application that answers: the page's, with its session, or a refusal."""
        came = HTTPConnection(scope)
        follow_choice(came)
        if refusal := self._foreign(came) or refused_size(came.headers):
            return _error(*refusal)
        if self._links.opens(scope):
            return self._shared
        if (token := _live_token(came)) is not None:
            if (session := self._people.tokens.session_of_link(token)) is None:
                return _error(
                    401, "this link has expired, or its session has ended; make a new one"
                )
            scope["session"] = session
            return self._app
        session = self._people.tokens.session(came.cookies.get(self._people.cookie.name))
        if scope["type"] == "http":
            request = Request(scope, receive)
            if scope["path"] == "/login":
                return await self._login(request, session)
            token = came.query_params.get("token")
            if token and scope["path"] == "/" and request.method == "GET":
                return self._link(request, token, session)
            if session is None and _wants_page(request):
                return self._sign_in_page(401, "You are not signed in here.")
        if session is None:
            return _error(
                401, "not signed in; open the sign-in link quadlab printed, or sign in at /login"
            )
        scope["session"] = session
        return self._app

    def _foreign(self, came: HTTPConnection) -> tuple[int, str] | None:
        host = came.headers.get("host", "").lower()
        if host not in self._hosts:
            return 403, f"this is not {host!r:.80}; open {self._base_url}/ instead"
        guarded = came.scope["type"] == "websocket" or came.scope["method"] not in SAFE_METHODS
        guarded = guarded and _live_token(came) is None  # asked by the token's holder, no browser
        origin = came.headers.get("origin")
        # Programs send no Origin; browsers always do on a POST, a PUT and a websocket.
        if guarded and origin is not None and origin.lower() != f"{self._scheme}://{host}":
            return 403, f"refused: the request comes from another site ({origin:.80})"
        if guarded and came.headers.get("sec-fetch-site", OURS) != OURS:
            return 403, "refused: the request comes from another site"
        return None

    def _link(self, request: Request, token: str, session: Session | None) -> Response:
        role = self._people.tokens.role(token)
        if session is not None and role in (None, session.role):
            # This is a bookmark or a second click: leave the token to someone else.
            return page_response(signed_in_page())
        if role is None:
            refusal = self._people.sign_in.refuse_link(token, address_of(request))
            return self._sign_in_page(refusal.status, refusal.line)
        return link_page(token)

    async def _login(self, request: Request, session: Session | None) -> Response:
        if request.method in ("GET", "HEAD"):
            return self._sign_in_page(200, "Sign in to quadlab.")
        if request.method != "POST":
            return _error(405, "sign in with POST", {"allow": "GET, POST"})
        try:
            form = await read_form(request)
        except ValueError as error:
            return _error(400, str(error))
        if "token" not in form:
            name, password = form.get("name", ""), form.get("password", "")
            outcome = await self._people.sign_in.by_password(name, password, address_of(request))
            return self._answer(request, outcome, name)
        role = self._people.tokens.role(form["token"])
        if session is None or (role is not None and "replace" in form):
            outcome = await self._people.sign_in.by_link(form["token"], address_of(request))
            return self._answer(request, outcome)
        if role in (None, session.role):
            return self._answer(request, session)
        if _wants_page(request):
            return page_response(replace_page(form["token"], session, role))
        return _error(409, f"signed in as {session.label}; sign out first, or send replace=1")

    def _answer(self, request: Request, outcome: Session | Refusal, name: str = "") -> Response:
        """Answer a form with the session that it opened, or why it opened none."""
        answer: Response
        if isinstance(outcome, Refusal):
            if _wants_page(request):
                answer = self._sign_in_page(outcome.status, outcome.line, name)
            else:
                answer = _error(outcome.status, outcome.line)
            if outcome.wait:
                answer.headers["retry-after"] = str(outcome.wait)
            return answer
        if _wants_page(request):  # the form was ours, so a redirect carries the cookie
            answer = page_response(signed_in_page(), 303, {"location": "/"})
        else:
            fields = {"label": outcome.label, "role": outcome.role.value}
            answer = JSONResponse(fields, headers=NO_STORE)
        return self._people.signed_in(answer, outcome)

    def _sign_in_page(self, status: int, line: str, name: str = "") -> Response:
        with_password = self._people.accounts.count() > 0
        page = sign_in_page(line, name, self._base_url, with_password=with_password)
        return page_response(page, status)


def _live_token(came: HTTPConnection) -> str | None:
    """Return the token of a live link, or None.

    Foxglove connects from its own page, which does not send this page's cookie.
    """
    is_live = came.scope["type"] == "websocket" and came.scope["path"].endswith("/foxglove")
    return came.query_params.get("token") if is_live else None


def _error(status: int, line: str, headers: dict[str, str] | None = None) -> Response:
    return JSONResponse({"error": line}, status, {**NO_STORE, **(headers or {})})


def _wants_page(request: Request) -> bool:
    return "text/html" in request.headers.get("accept", "")


def _with_policy(send: Send) -> Send:
    """Add the headers that every answer carries; an answer may set its own content policy.

    There is no Strict-Transport-Security: it would keep a browser from this computer's other ports,
    and from this one once TLS is off again. With a private authority that is not yet trusted, it
    would not even let the user proceed. Referrer-Policy is not `no-referrer`, because a browser
    then sends a form with `Origin: null`.
    """

    async def sending(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            headers["x-content-type-options"] = "nosniff"
            headers["referrer-policy"] = "same-origin"
            headers.setdefault("content-security-policy", PAGE_POLICY)
            headers.setdefault("cache-control", "no-cache")
        await send(message)

    return sending
