"""Passwords: the rules for new ones, and their argon2id hashes (RFC 9106).

They are hashed outside the event loop, two at a time, with a short queue.
"""

from __future__ import annotations

import asyncio
import base64
import secrets
import unicodedata
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from quadrotor.errors import QuadlabError, RefusedError

if TYPE_CHECKING:
    from argon2 import PasswordHasher

SHORTEST = 10  # characters
LONGEST = 500
AT_ONCE = 2
WAITING = 16  # including those being hashed; each takes about 0.1 s and 64 MiB

P = ParamSpec("P")
T = TypeVar("T")


def check_password(name: str, password: str) -> None:
    """Check a new password. Raises RefusedError with the reason."""
    plain = _normal(password)
    if len(plain) < SHORTEST:
        came = f"it has {len(plain)}" if plain else "it is empty"
        raise RefusedError(
            f"the password is too short: {came}, at least {SHORTEST} characters are needed; "
            "a few words in a row are easy to remember"
        )
    if len(plain) > LONGEST:
        raise RefusedError(f"the password has {len(plain)} characters; allowed are {LONGEST}")
    if plain.lower() == name or len(set(plain)) == 1:
        raise RefusedError("the password is too easy to guess; choose another")


class Passwords:
    """Hashing and verification of passwords.

    A call takes about 0.1 s and 64 MiB: never call it on an event loop. It uses one lane, not the
    four of RFC 9106, because the flight process has a core of this computer.
    """

    def __init__(self, time_cost: int = 3, memory_cost: int = 64 * 1024) -> None:
        self._time_cost, self._memory_cost = time_cost, memory_cost
        self._made: PasswordHasher | None = None

    @property
    def _hasher(self) -> PasswordHasher:
        if self._made is None:
            from argon2 import PasswordHasher

            self._made = PasswordHasher(self._time_cost, self._memory_cost, parallelism=1)
        return self._made

    def hash(self, password: str) -> str:
        return self._hasher.hash(_normal(password))

    def matches(self, encoded: str | None, password: str) -> bool:
        """Return whether the password fits.

        Without a hash (no account has that name) the same work is done in vain, so that the time
        taken does not reveal which names exist.
        """
        from argon2.exceptions import InvalidHashError, VerificationError

        try:
            fits = self._hasher.verify(encoded or self._of_nobody(), _normal(password))
        except (VerificationError, InvalidHashError):
            return False
        return fits and encoded is not None

    def is_outdated(self, encoded: str) -> bool:
        """Return whether the hash was made with other costs than the present ones.

        If so, make it again while the password is available.
        """
        return self._hasher.check_needs_rehash(encoded)

    def _of_nobody(self) -> str:
        costs = self._hasher
        head = f"m={costs.memory_cost},t={costs.time_cost},p={costs.parallelism}"
        return f"$argon2id$v=19${head}${_random(16)}${_random(32)}"


def _normal(password: str) -> str:
    """Return the password in the Unicode form NFKC: keyboards write some characters differently."""
    return unicodedata.normalize("NFKC", password)


def _random(size: int) -> str:
    return base64.b64encode(secrets.token_bytes(size)).decode().rstrip("=")


class BusyError(QuadlabError):
    """Too many passwords are being checked at once."""


class Hashing:
    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="hashing")
        self._under_way = 0

    async def run(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a function in the hashing threads. Raises BusyError if the queue is full."""
        if self._under_way >= WAITING:
            raise BusyError("too many sign-ins at once; try again in a few seconds")
        self._under_way += 1
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._executor, lambda: function(*args, **kwargs))
        finally:
            self._under_way -= 1

    def stop(self) -> None:
        self._executor.shutdown(wait=False, cancel_futures=True)
