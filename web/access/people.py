"""The users in one place: accounts, sessions, sign-in, cookie, open sockets."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.responses import Response

from quadrotor.errors import StorageError
from web.access.accounts import Accounts
from web.access.database import AccessDatabase
from web.access.open_sockets import OpenSockets
from web.access.passwords import Hashing, Passwords
from web.access.roles import Session
from web.access.sessions import SESSION_AGE, Sessions
from web.access.sign_in import SignIn
from web.access.sign_in_limiter import SignInLimiter
from web.access.sign_in_tokens import SignInTokens

SEEN_PERIOD = 30.0  # s, between writes of when each user was last seen


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


@dataclass(frozen=True)
class People:
    """The users of one data folder and one page."""

    database: AccessDatabase
    accounts: Accounts
    sessions: Sessions
    tokens: SignInTokens
    cookie: SessionCookie
    hashing: Hashing
    sign_in: SignIn
    sockets: OpenSockets

    def signed_in(self, answer: Response, session: Session) -> Response:
        """Return the answer with the session's cookie."""
        self.cookie.set(answer, self.tokens.sign(session))
        return answer

    async def run(self) -> None:
        """Store when each user was last seen; a disk that is full for a while does not end this."""
        while True:
            await asyncio.sleep(SEEN_PERIOD)
            with contextlib.suppress(StorageError):
                await asyncio.to_thread(self.sessions.write_seen)

    def stop(self) -> None:
        with contextlib.suppress(StorageError):
            self.sessions.write_seen()
        self.hashing.stop()
        self.database.close()


def open_people(
    folder: Path,
    base_url: str,
    token: str | None,
    say: Callable[[str, str], None],
    on_link: Callable[[str], None],
    limiter: SignInLimiter | None = None,
    passwords: Passwords | None = None,
) -> People:
    """Open the accounts and sessions in `<data>/web`.

    Args:
        token: see `given` of `web.access.sign_in_tokens.SignInTokens`.
        say, on_link, limiter: see `web.access.sign_in.SignIn`.

    Raises StorageError.
    """
    database = AccessDatabase(folder)
    accounts = Accounts(database, passwords)
    sessions = Sessions(database)
    tokens = SignInTokens(folder, sessions, token)
    hashing = Hashing()
    return People(
        database=database,
        accounts=accounts,
        sessions=sessions,
        tokens=tokens,
        cookie=SessionCookie(base_url),
        hashing=hashing,
        sign_in=SignIn(
            tokens=tokens,
            accounts=accounts,
            sessions=sessions,
            hashing=hashing,
            say=say,
            on_link=on_link,
            limiter=limiter,
        ),
        sockets=OpenSockets(sessions),
    )
