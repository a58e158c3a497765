"""The judgement of oscillations on compiled flights: time until it is told, and false alarms.

    python -m benchmarks oscillation [--hours 100]

The paper's law flies with `vehicle.safety.oscillation` beside it in each tick, as on board:

- with gains set wrong in hover or in the 8: s from the first error of 30 mm to the alarm;
- with good gains, half of each flight hovering, half in the 8, in clean and in rough air: alarms.

Sensors, filter, tracker and plant are those of `quadlab.batch`, which loses no samples of the IMU.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from control.geometric_law import CONTROL_MEMORY, new_control_memory, step_one
from control.laws import Bytes, CompiledLaw, Own, Records
from control.parameters import CONTROL, ControlParameters, control_record
from control.trajectories.figure_eight import FigureEight
from extensions.batches.batch import Scenario, fly_batch
from quadrotor.compiled import compiled
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.safety.oscillation import OFF, WATCH, watch
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.presets import preset_values

GAINS: tuple[dict[str, ParameterValue], ...] = (
    {"position.kp_xy": 13.6},
    {"position.kp_xy": 20.0},
    {"position.kv_xy": 0.5},
    {"position.kv_xy": 10.0},
    {"attitude.kr_xy": 15.0},
    {"attitude.kr_xy": 200.0},
    {"attitude.kw_xy": 2.0},
    {"attitude.kr_z": 50.0, "attitude.kw_z": 0.0},
)
"""Gains of which each is set wrong in flight."""
WORLDS = ("clean", "rough")
OWN = ControlParameters(law="watched")
SEEDS = 8, 4, 1  # of each size, for each of the gains
HOURS = 100.0, 2.0, 0.05
LAPS, HOVER, WRONG_AFTER, WRONG_FOR = 14, 120.0, 30.0, 30.0
"""Laps of a good flight and s of hover before them; s of good gains in hover or in the 8 before one
is set wrong, and s after."""
ERROR = 0.03
"""Tracking error, m, from which the time until the alarm counts."""
TIME, RARE = 1.5, {"clean": 1.0, "rough": 10.0}
"""Limits: s from that error to the alarm, and alarms in 100 h of each world."""

JUDGED = WATCH.itemsize
"""Bytes of the judgement's own memory, which is the first part of the law's."""

WATCHED = np.dtype(
    [
        ("watch", WATCH),
        ("controller", CONTROL_MEMORY),
        ("wrong", CONTROL),
        ("wrong_from", "f8"),  # s, when the wrong gains begin to fly
        ("time", "f8"),  # s
        ("found", "i8"),  # as `watch` returned it in the last tick
        ("oscillations", "i8"),  # times at which it began to tell of one
        ("strayed", "i8"),  # times at which it began to tell of a distance
        ("erred_at", "f8"),  # s, of the first error with wrong gains; NaN before
        ("told_at", "f8"),  # s, of the first alarm with wrong gains; NaN before
    ],
    align=True,
)
"""The memory of the watched law."""


@compiled(pointer=True)
def fly_watched(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Fly the paper's law, from a moment on with other gains, and judge each tick."""
    memory, _ = own
    state, reference, control, model, actuators = records
    m = memory.view(WATCHED)[0]
    m.time += dt
    is_wrong = m.time >= m.wrong_from
    gains = m.wrong if is_wrong else control[0]
    out = actuators[0]
    step_one(m.controller, state[0], reference[0], gains, model[0], airborne, dt=dt, actuators=out)
    found = watch(state, reference, memory[:JUDGED].view(WATCH), dt)
    if found != m.found and found >= 0:
        if found == OFF:
            m.strayed += 1
        else:
            m.oscillations += 1
        if is_wrong and math.isnan(m.told_at):
            m.told_at = m.time
    m.found = found
    square = 0.0
    for i in range(3):
        square += (state[0].position_w[i] - reference[0].position_w[i]) ** 2
    if is_wrong and math.isnan(m.erred_at) and square > ERROR * ERROR:
        m.erred_at = m.time


@dataclass(frozen=True)
class WatchedLaw(CompiledLaw):
    """The paper's law with the judgement beside it.

    Attributes:
        wrong: the gains that are flown from `wrong_from` (s) on.
        memories: of the flights that have begun, in any order.
    """

    wrong: ControlParameters = field(default_factory=ControlParameters)
    wrong_from: float = math.inf
    memories: list[Bytes] = field(default_factory=list)

    def new_memory(self) -> Bytes:
        """Return the memory of a flight that begins, and keep it."""
        made = np.zeros(1, WATCHED)
        made["watch"]["channel"] = made["found"] = -1
        made["controller"] = new_control_memory()
        made["wrong"], made["wrong_from"] = control_record(self.wrong), self.wrong_from
        made["erred_at"] = made["told_at"] = math.nan
        self.memories.append(made.view(np.uint8))
        return self.memories[-1]


def run(size: Size = Size.FULL, hours: float | None = None) -> Report:
    """Measure with all wrong gains, and with good ones in both worlds."""
    hours, seeds = hours or size.of(*HOURS), range(1, size.of(*SEEDS) + 1)
    report = Report(
        "oscillation",
        "The judgement of oscillations",
        [
            f"compiled flights at 500 Hz with all sensors and the tracker; {len(seeds)} seeds for "
            "each of the gains, which are set wrong in hover or in the 8",
            f"time: from the first error of {1e3 * ERROR:g} mm, 0 for an alarm before it; gains "
            "that are good are the defaults, half of each flight hovers, half flies the 8",
        ],
    )
    longest, untold = 0.0, 0
    for wrong in size.some(GAINS):
        for eight in (False, True):
            late, missed = tell_wrong(wrong, eight=eight, seeds=seeds)
            longest, untold = max(longest, *late), untold + missed
            name = ", ".join(f"{key.rpartition('.')[2]} {value:g}" for key, value in wrong.items())
            figures = {"flights": float(len(seeds)), "told": float(len(late))}
            if late:
                figures |= {"time, median, s": float(np.median(late)), "longest, s": max(late)}
            report.rows.append(Row(f"{name} in {'the 8' if eight else 'hover'}", {**figures}))
    for world in WORLDS:
        flown, oscillations, strayed = fly_good(world, hours)
        report.rows.append(
            Row(
                f"good gains, {world}",
                {"hours": flown, "alarms": oscillations, "told to be off the reference": strayed},
            )
        )
        often = 100.0 * oscillations / flown
        report.targets.append(Target(f"{world}: false alarms in 100 h", often, RARE[world]))
    report.targets.append(Target("longest time to the alarm, s", longest, TIME))
    report.targets.append(Target("errors that no alarm told", float(untold), 0.0))
    return report


def tell_wrong(
    wrong: dict[str, ParameterValue], *, eight: bool, seeds: Sequence[int]
) -> tuple[list[float], int]:
    """Return s from the error to the alarm in each flight with one, and how many had none.

    Flights whose error stays below ERROR do not count.
    """
    gains = ControlParameters()
    ParameterStore(gains).set(wrong)
    law = WatchedLaw(fly_watched, WATCHED, wrong=gains, wrong_from=WRONG_AFTER)
    whole = WRONG_AFTER + WRONG_FOR
    fly([Scenario(control=OWN, seed=one) for one in seeds], whole, 8.0 if eight else whole, law)
    late, untold = [], 0
    for memory in law.memories:
        m = memory.view(WATCHED)[0]
        if not math.isnan(m["told_at"]):
            late.append(max(0.0, float(m["told_at"] - m["erred_at"])))
        elif not math.isnan(m["erred_at"]):
            untold += 1
    return late, untold


def fly_good(world: str, hours: float) -> tuple[float, float, float]:
    """Return the hours flown with good gains, alarms of an oscillation, and of a distance."""
    eight = FigureEight((0.0, 0.0, 1.0), laps=LAPS)
    truth = SimulatorParameters()
    ParameterStore(truth).set(preset_values(world))
    seconds = HOVER + eight.duration
    count, law = math.ceil(3600.0 * hours / seconds), WatchedLaw(fly_watched, WATCHED)
    scenarios = [
        Scenario(truth=truth, control=OWN, trajectory=eight, seed=1000 + k) for k in range(count)
    ]
    fly(scenarios, seconds, HOVER, law)
    found = [memory.view(WATCHED)[0] for memory in law.memories]
    flown = sum(float(one["time"]) for one in found) / 3600.0
    oscillations = float(sum(one["oscillations"] for one in found))
    strayed = float(sum(one["strayed"] for one in found))
    return flown, oscillations, strayed


def fly(scenarios: Sequence[Scenario], seconds: float, hover: float, law: WatchedLaw) -> None:
    """Fly the scenarios with the watched law, which keeps what it found."""
    fly_batch(scenarios, seconds, hover=hover, others={OWN.law: law})
