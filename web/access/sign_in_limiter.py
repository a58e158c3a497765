"""Limit on the attempts at a password: a few failures are free, then each doubles the wait.

Failures are counted per address (an IPv6 network of 64 bits is one address) and per name. An
attempt counts as a failure when it begins and is cleared when it succeeds, so that many attempts at
once gain nothing.
"""

from __future__ import annotations

import ipaddress
import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

FREE = 5  # failures without a wait
FIRST_WAIT = 2.0  # s
LONGEST_WAIT = 300.0  # s
FORGOTTEN = 3600.0  # s without a failure
REMEMBERED = 4096  # addresses and names held in memory


@dataclass(slots=True)
class _Record:
    failures: int
    last: float  # s
    until: float  # s; no attempt is allowed before


class SignInLimiter:
    """Counters of failures by address and name, with a clock in s.

    The memory is bounded: the least recent counters are dropped.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._records: OrderedDict[tuple[str, str], _Record] = OrderedDict()

    def begin(self, address: str, name: str) -> float:
        """Begin an attempt: return 0, or the wait, in s, until it is allowed.

        An allowed attempt counts as a failure until it succeeds.
        """
        now = self._clock()
        keys = _keys(address, name)
        wait = max(self._wait(key, now) for key in keys)
        if wait > 0.0:
            return wait
        for key in keys:
            record = self._records.pop(key, None)
            if record is None or now - record.last > FORGOTTEN:
                record = _Record(0, now, now)
            record.failures += 1
            record.last = now
            record.until = now + _wait_after(record.failures)
            self._records[key] = record
        while len(self._records) > REMEMBERED:
            self._records.popitem(last=False)
        return 0.0

    def succeeded(self, address: str, name: str) -> None:
        """Clear the failures of address and name."""
        for key in _keys(address, name):
            self._records.pop(key, None)

    def wait(self, address: str, name: str) -> int:
        """Return the whole seconds until another attempt is allowed."""
        now = self._clock()
        return math.ceil(max(self._wait(key, now) for key in _keys(address, name)))

    def __len__(self) -> int:
        return len(self._records)

    def _wait(self, key: tuple[str, str], now: float) -> float:
        record = self._records.get(key)
        return 0.0 if record is None else max(0.0, record.until - now)


def _wait_after(failures: int) -> float:
    if failures < FREE:
        return 0.0
    return min(FIRST_WAIT * 2.0 ** min(failures - FREE, 20), LONGEST_WAIT)


def _keys(address: str, name: str) -> tuple[tuple[str, str], tuple[str, str]]:
    return ("address", _network(address)), ("name", name[:64])


def _network(address: str) -> str:
    try:
        parsed = ipaddress.ip_address(address.split("%", maxsplit=1)[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv6Address):
        if parsed.ipv4_mapped is not None:
            return str(parsed.ipv4_mapped)
        return str(ipaddress.ip_network((parsed, 64), strict=False))
    return str(parsed)
