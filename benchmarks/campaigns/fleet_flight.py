"""The cost of flying several whole vehicles in one simulated time, over that of one.

    python -m benchmarks fleet_flight

Each vehicle flies the 8 as `quadlab fly figure_eight --vehicles N` has it: a whole stack, its
sensors, its log, and a meeting with all others each 10 ms.
"""

from __future__ import annotations

import os
import statistics
import tempfile
from pathlib import Path

from benchmarks.harness import Report, Row, Size, Target
from quadlab.simulated.together import FlownTogether, fly_together

ONE_LAP = "experiment.laps=rest_to_rest", "experiment.yaw_amplitude=0.7"


def run(size: Size = Size.FULL) -> Report:
    """Fly one and several vehicles in turns."""
    count, rounds = size.of((8, 7), (8, 2), (2, 1))
    words = size.of((), (), ONE_LAP)
    report = Report(
        "fleet_flight",
        "Several whole vehicles in one simulated time",
        [
            f"median of {rounds} rounds in turns, {len(os.sched_getaffinity(0))} processors; "
            "start and judging not included"
        ],
    )
    flown: dict[int, list[FlownTogether]] = {1: [], count: []}
    with tempfile.TemporaryDirectory(prefix="quadlab-benchmark-") as folder:
        for number in range(rounds):
            for vehicles, done in flown.items():
                out = Path(folder) / str(number)
                done.append(fly_together("figure_eight", vehicles, words=words, out=out))
                for log in done[-1].logs.values():
                    log.unlink()
    for vehicles, done in flown.items():
        figures: dict[str, float | str] = {
            "times real time": statistics.median(one.flown / one.wall for one in done),
            "processor, s a vehicle": statistics.median(
                one.processor / len(one.logs) for one in done
            ),
            "passed": f"{sum(one.verdict == 'passed' for one in done)} of {rounds}",
        }
        report.rows.append(Row(f"{vehicles} vehicles", figures))
    turns = zip(flown[count], flown[1], strict=True)
    ratio = statistics.median(many.processor / count / one.processor for many, one in turns)
    speed = statistics.median(one.flown / one.wall for one in flown[count])
    report.targets = [
        Target(f"{count} vehicles: times real time", speed, 3.0, at_most=False),
        Target("processor time a vehicle over that of one", ratio, 1.1),
    ]
    return report
