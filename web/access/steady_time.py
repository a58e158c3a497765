"""Time by which sessions and links end: setting the computer's clock changes nothing about it."""

from __future__ import annotations

from itsdangerous import TimestampSigner

from vehicle_link.clock import host_time_ns


def steady_time() -> float:
    """Return the epoch time in s, which setting the computer's clock does not move."""
    return host_time_ns() * 1e-9


class SteadySigner(TimestampSigner):
    """A signer whose signatures age by `steady_time`."""

    def get_timestamp(self) -> int:
        """Return the present time for a signature, whole epoch seconds."""
        return int(steady_time())
