"""Time by which sessions and links end: setting the computer's clock changes nothing about it."""

from __future__ import annotations

import time

from itsdangerous import TimestampSigner

_AHEAD_S = time.time() - time.monotonic()


def steady_time() -> float:
    """Return the epoch time in s as of this process's start, continued by the steady clock."""
    return _AHEAD_S + time.monotonic()


class SteadySigner(TimestampSigner):
    """A signer whose signatures age by `steady_time`."""

    def get_timestamp(self) -> int:
        """Return the present time for a signature, whole epoch seconds."""
        return int(steady_time())
