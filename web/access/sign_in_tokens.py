"""Entry to the page: one-time sign-in tokens and the signed session cookie.

A token signs one browser in and is consumed by it. Then a new one is created, so that there is
always exactly one way in for the next person; it is shown only in the terminal. The terminal's
token opens an admin's session, because the person who can read it owns the data folder anyway.
Tokens and the secret that signs cookies are stored in `<data>/web/door.json` (mode 0600), open
sessions in `web.access.sessions`: both survive a restart.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import threading
from pathlib import Path
from typing import Any

from itsdangerous import BadSignature, URLSafeTimedSerializer

from quadrotor.errors import StorageError
from vehicle_link.security.tls_files import write_secret
from web.access.roles import Role, Session
from web.access.sessions import Sessions
from web.access.steady_time import SteadySigner

REMEMBERED = 200  # consumed tokens remembered, so that a supervisor cannot make one valid again
LINK_AGE = 600  # s for which a live link is valid
OPEN_AT_ONCE = 20  # unused tokens kept; each start of `quadlab up` leaves one


class SignInTokens:
    """Tokens and sessions of one data folder; thread-safe.

    Args:
        folder: `<data>/web`, made if missing.
        sessions: the open sessions.
        given: a token chosen by the process that started this one (`quadlab up`); ignored if used.

    Raises StorageError when the folder or its file cannot be read or written.
    """

    def __init__(self, folder: Path, sessions: Sessions, given: str | None = None) -> None:
        self._path = folder / "door.json"
        self._sessions = sessions
        self._lock = threading.Lock()
        self._state = self._load()
        self._serializer = _serializer(self.secret, "quadlab-session")
        self._links = _serializer(self.secret, "quadlab-live-link")
        used = given is not None and _digest(given) in self._state["used"]
        if given is not None and not used and given not in self._state["tokens"]:
            self._state["tokens"][given] = Role.ADMIN.value
        self._ensure_one()
        tokens = self._state["tokens"]
        self._state["tokens"] = dict(list(tokens.items())[-OPEN_AT_ONCE:])
        self._save()

    @property
    def secret(self) -> str:
        """Return the secret that signs cookies and links."""
        secret: str = self._state["secret"]
        return secret

    @property
    def token(self) -> str:
        """Return the newest unused token of an admin."""
        return self._admin_tokens()[-1]

    def mint(self, role: Role) -> str:
        """Create a one-time token, valid until it is used."""
        with self._lock:
            token = secrets.token_urlsafe(24)
            self._state["tokens"][token] = role.value
            self._save()
            return token

    def consume(self, token: str) -> Session | None:
        """Return the session that the token opens, or None if it is wrong or used."""
        with self._lock:
            known = self._known(token)
            if known is None:
                return None
            role = Role(self._state["tokens"].pop(known))
            self._state["used"] = [*self._state["used"], _digest(token)][-REMEMBERED:]
            self._state["seats"][role.value] = seat = self._state["seats"].get(role.value, 0) + 1
            self._ensure_one()
            self._save()
        return self._sessions.open(f"{role.value} {seat}", role)

    def role(self, token: str) -> Role | None:
        """Return the role that an unused token opens, or None if it is wrong or used."""
        with self._lock:
            known = self._known(token)
            return Role(self._state["tokens"][known]) if known else None

    def was_used(self, token: str) -> bool:
        return _digest(token) in self._state["used"]

    def sign(self, session: Session) -> str:
        """Return the cookie's value."""
        return _signed(self._serializer, session)

    def session(self, cookie: str | None) -> Session | None:
        """Return the session of a cookie's value.

        It is None if the value is forged or from another data folder, or if its session has ended
        or is too old, which `Sessions` knows.
        """
        return self._read(self._serializer, cookie, None)

    def sign_link(self, session: Session) -> str:
        """Return a token with which a program without a cookie connects as this session.

        It is valid for LINK_AGE.
        """
        return _signed(self._links, session)

    def session_of_link(self, token: str) -> Session | None:
        """Return the session of a token from `sign_link`, or None as `session` does."""
        return self._read(self._links, token, LINK_AGE)

    def _read(
        self, signer: URLSafeTimedSerializer, value: str | None, age: int | None
    ) -> Session | None:
        if not value:
            return None
        try:
            key, label, role, generation, issued = signer.loads(value, max_age=age)
            session = Session(str(label), Role(role), str(key), int(generation), int(issued))
        except (BadSignature, TypeError, ValueError):
            return None
        return session if self._sessions.is_open(session) else None

    def _known(self, token: str) -> str | None:
        sent = token.encode()
        known = [t for t in self._state["tokens"] if secrets.compare_digest(t.encode(), sent)]
        return known[0] if known else None

    def _admin_tokens(self) -> list[str]:
        return [t for t, role in self._state["tokens"].items() if role == Role.ADMIN]

    def _ensure_one(self) -> None:
        if not self._admin_tokens():
            self._state["tokens"][secrets.token_urlsafe(24)] = Role.ADMIN.value

    def _load(self) -> dict[str, Any]:
        fresh = {"secret": secrets.token_urlsafe(32), "tokens": {}, "used": [], "seats": {}}
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            state = json.loads(self._path.read_text())
        except FileNotFoundError:
            return fresh
        except OSError as error:
            raise StorageError(
                f"cannot read {self._path} ({error.strerror}); "
                "check the data folder's owner, or choose another with --data"
            ) from error
        except ValueError:
            state = None
        if not isinstance(state, dict) or state.keys() != fresh.keys():
            raise StorageError(
                f"{self._path} is damaged; delete it, and everyone signs in again "
                "with the link that quadlab prints"
            )
        return state

    def _save(self) -> None:
        """Write all or nothing: a crash leaves the old file or the new one."""
        try:
            write_secret(self._path, json.dumps(self._state).encode())
        except OSError as error:
            raise StorageError(
                f"cannot write {self._path} ({error.strerror}); "
                "check the data folder's owner and free space, or choose another with --data"
            ) from error


def _serializer(secret: str, salt: str) -> URLSafeTimedSerializer:
    return URLSafeTimedSerializer(secret, salt=salt, signer=SteadySigner)


def _signed(signer: URLSafeTimedSerializer, session: Session) -> str:
    content = [session.id, session.label, session.role.value, session.generation, session.issued]
    signed = signer.dumps(content)
    return signed if isinstance(signed, str) else signed.decode()


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()
