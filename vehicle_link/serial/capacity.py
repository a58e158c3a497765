"""The number of IMU samples a second that the serial ports can carry, and hence the rate limit of
the flight loop.
"""

from __future__ import annotations

from quadrotor.errors import UsageError
from vehicle_link.serial.port import BAUD_RATE

BYTES_PER_SECOND = BAUD_RATE // 10
"""Bytes a second in each direction; each byte has a start and a stop bit."""
DATA_FRAME = 34
"""Bytes of a `D` frame. Commands in the other direction have 14, so samples are the bottleneck."""
RATE_MIN, RATE_MAX = 60, 1000
DEFAULT_RATE = 500
"""Default rate with two ports, Hz."""


def samples_a_second(ports: int) -> int:
    """Return how many samples a second so many ports can carry."""
    return ports * BYTES_PER_SECOND // DATA_FRAME


def sample_period_us(rate: int) -> int:
    """Return the microseconds between two samples, the value for Id.MIRROR_PERIOD."""
    return round(1e6 / rate)


def check_rate(rate: int, ports: int | None) -> None:
    """Check that `ports` can carry `rate` (Hz); `ports` is None when samples stay in memory.

    Raises UsageError with what is allowed.
    """
    if not RATE_MIN <= rate <= RATE_MAX:
        raise UsageError(
            f"--rate {rate} is not allowed; allowed are {RATE_MIN} to {RATE_MAX} Hz, "
            f"{DEFAULT_RATE} is the default, {default_rate(1)} with one port"
        )
    if ports is None or rate <= samples_a_second(ports):
        return
    carriers = "one serial port carries" if ports == 1 else f"{ports} serial ports carry"
    ways = "give both ports, " if ports == 1 and rate <= samples_a_second(2) else ""
    raise UsageError(
        f"--rate {rate}: {carriers} {samples_a_second(ports)} samples a second at {BAUD_RATE} Bd "
        f"({DATA_FRAME} bytes each); {ways}try --rate {rate_below(ports)}, or fly a simulated "
        "vehicle without ports: quadlab vehicle --in-process"
    )


def default_rate(ports: int) -> int:
    """Return the default rate in Hz."""
    return min(DEFAULT_RATE, rate_below(ports))


def rate_below(ports: int) -> int:
    """Return a round rate (Hz) that so many ports can carry."""
    return samples_a_second(ports) // 50 * 50
