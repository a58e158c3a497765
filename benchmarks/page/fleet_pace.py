"""The speed of the simulation with one, two and three vehicles under `quadlab up`, a page open.

    python -m benchmarks fleet_pace

The vehicles fly eights in lockstep, each at the rate that `quadlab up` chooses for so many. The
factor is the time of the simulation over the time that passes; 1 is real time.
"""

from __future__ import annotations

import statistics
import time

import httpx

from benchmarks.harness import Report, Row, Size
from benchmarks.page.laboratory import started
from benchmarks.page.up_cost import LAPS, PATIENCE, Pilot, page, pilot

PORT, LINK_PORT = 28102, 28472
COUNTS = 1, 2, 3
SETTLED, SECONDS = (5.0, 5.0, 0.5), (30.0, 10.0, 0.5)  # of each size
LOOK = 0.5  # s


def run(size: Size = Size.FULL) -> Report:
    """Measure with each number of vehicles."""
    report = Report(
        "fleet_pace",
        "The speed of the simulation, by vehicles",
        ["all fly eights in lockstep; a client has the three websockets of the first one's page"],
    )
    for count in size.some(COUNTS):
        began = time.monotonic()
        with (
            started(PORT, LINK_PORT, "--vehicles", str(count), lockstep=True) as (_, lines),
            pilot(lines, PORT, began) as first,
        ):
            report.rows.append(Row(f"{count} vehicles", measure(first, count, size)))
    return report


def measure(first: Pilot, count: int, size: Size) -> dict[str, float | str]:
    """Return rate and real-time factor while all vehicles fly."""
    for number in range(1, count + 1):
        with httpx.Client(timeout=PATIENCE, cookies=first.browser.cookies) as browser:
            one = first.of_vehicle(browser, f"quad{number}") if count > 1 else first
            one.take_off()
            one.start("follow_trajectory", "follow_trajectory", laps=LAPS)
    factors = list[float]()
    with page(first):
        time.sleep(size.of(*SETTLED))
        end = time.monotonic() + size.of(*SECONDS)
        while time.monotonic() < end:
            time.sleep(LOOK)
            factors.append(first.summary()["station"]["real_time_factor"] or 1.0)
    return {
        "ticks a second": first.summary()["status"]["nominal_rate"],
        "real-time factor, median": statistics.median(factors),
        "least": min(factors),
    }
