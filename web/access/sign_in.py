"""Sign-in by a one-time link, or by name and password; each is published as an event."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import parse_qsl

from starlette.requests import ClientDisconnect, HTTPConnection, Request

from web.access.accounts import Account, Accounts
from web.access.passwords import BusyError, Hashing
from web.access.roles import Session
from web.access.sessions import Sessions
from web.access.sign_in_limiter import SignInLimiter
from web.access.sign_in_tokens import SignInTokens

LARGEST_FORM = 4096  # bytes
FORM_TIME = 10.0  # s in which a form must arrive
_log = logging.getLogger("quadlab.web")


@dataclass(frozen=True, slots=True)
class Refusal:
    """Refused sign-in with its reason; `wait` is the time, in s, before the next try is allowed."""

    status: int
    line: str
    wait: int = 0


class SignIn:
    """Sign-in of users; to be used from the event loop's thread.

    Args:
        say: called with level and text of a line for everyone's event list.
        on_link: called with the label of the person who used a link.
    """

    def __init__(
        self,
        tokens: SignInTokens,
        accounts: Accounts,
        sessions: Sessions,
        hashing: Hashing,
        say: Callable[[str, str], None],
        on_link: Callable[[str], None],
        limiter: SignInLimiter | None = None,
    ) -> None:
        self._tokens = tokens
        self._accounts = accounts
        self._sessions = sessions
        self._hashing = hashing
        self._say = say
        self._on_link = on_link
        self._limiter = SignInLimiter() if limiter is None else limiter
        self._link_limiter = SignInLimiter()  # so that wrong links do not fill the event list

    async def by_link(self, token: str, address: str) -> Session | Refusal:
        session = self._tokens.consume(token)
        if session is not None:
            self.report("info", f"{session.label} signed in by a link from {address}")
            self._on_link(session.label)
            return session
        return self.refuse_link(token, address)

    def refuse_link(self, token: str, address: str) -> Refusal:
        """Report a link that opens nothing, and return why."""
        was_used = self._tokens.was_used(token)
        if self._link_limiter.begin(address, address) == 0.0:
            what = "used" if was_used else "wrong"
            self.report("warn", f"a sign-in link that was {what} came from {address}")
        if was_used:
            return Refusal(401, "This sign-in link has been used; each one signs in one browser.")
        return Refusal(401, "This sign-in link is no longer valid.")

    async def by_password(self, name: str, password: str, address: str) -> Session | Refusal:
        """Sign in by password. The name is converted to lower case without blanks around it."""
        account = await self.verify(name.strip().lower(), password, address)
        if isinstance(account, Refusal):
            return account
        session = await self.open(account)
        self.report("info", f"{session.label} ({session.role}) signed in from {address}")
        return session

    async def verify(self, name: str, password: str, address: str) -> Account | Refusal:
        """Return the account of a name and its password.

        Attempts are limited by `web.access.sign_in_limiter`.
        """
        if self._limiter.begin(address, name) > 0.0:
            wait = self._limiter.wait(address, name)
            line = f"Too many wrong sign-ins; wait {wait} s, then try again."
            return Refusal(429, line, wait)
        try:
            account = await self._hashing.run(self._accounts.verify, name, password)
        except BusyError as error:
            return Refusal(503, f"{error}.", 3)
        if account is not None:
            self._limiter.succeeded(address, name)
            return account
        # Never log an unknown name, because people type their password in this field.
        names = {one.name for one in await asyncio.to_thread(self._accounts.all)}
        whose = f"the password of {name}" if name in names else "a name that is not known"
        wait = self._limiter.wait(address, name)
        then = f"; the next try from there is in {wait} s" if wait else ""
        self.report("warn", f"sign-in refused: {whose}, from {address}{then}")
        return Refusal(401, "The name or the password is wrong.", wait)

    async def open(self, account: Account) -> Session:
        return await asyncio.to_thread(
            self._sessions.open, account.name, account.role, account.generation
        )

    def report(self, level: str, text: str) -> None:
        """Publish a line in everyone's event list and in the log."""
        self._say(level, text)
        _log.log(logging.WARNING if level == "warn" else logging.INFO, "%s", text)


def address_of(came: HTTPConnection) -> str:
    """Return the address of the connection itself, because a header could name any."""
    return came.client.host if came.client else "unknown"


async def read_form(request: Request) -> dict[str, str]:
    """Read the fields of a form's body. Raises ValueError with the reason."""
    if int(request.headers.get("content-length", 0)) > LARGEST_FORM:
        raise ValueError(f"the form is too large; allowed are {LARGEST_FORM} bytes")
    try:
        async with asyncio.timeout(FORM_TIME):
            body = await request.body()
    except TimeoutError:
        raise ValueError("the form did not arrive in time") from None
    except ClientDisconnect:
        raise ValueError("the form was incomplete") from None
    return dict(
        parse_qsl(body.decode("utf-8", "replace"), keep_blank_values=True, max_num_fields=8)
    )
