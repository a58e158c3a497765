"""Laws at equal delay margin: the gains of each are scaled until it tolerates what another does.

The delay margin is the longest latency of commands with which a vehicle that starts beside its
place swings down there. It is found in flights on the true state, so that no noise hides the end of
an oscillation.

One factor s makes a law faster as a whole: a gain in 1/s is multiplied by s, one in 1/s² by s², one
in 1/s³ by s³, and cut-off frequencies by s. The predictive law has weights instead of gains. Its
weight of thrust is divided by s⁴, since the bandwidth of rotation is the fourth root of the ratio
of the weights of attitude and thrust.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from control.trajectories.figure_eight import FigureEight
from extensions.laws.arena.cells import Entry
from extensions.laws.arena.courses import PERIOD
from extensions.laws.arena.flights import door
from quadrotor.errors import UsageError
from quadrotor.parameters import ParameterStore
from vehicle.simulator.parameters import SimulatorParameters

POWERS = {"1/s": 1, "rad/s": 1, "1/s²": 2, "1/s³": 3}
"""Power of the factor by the unit of a parameter."""
WEIGHTS = {"nmpc.thrust": -4}
"""Power of the factor for parameters without such a unit."""
SHARED = "position.", "attitude.", "disturbance."
"""Groups of parameters that laws share."""
LONGEST = 0.1
"""s, the longest latency of commands."""
SMALLEST, LARGEST, STEPS = 0.5, 2.0, 10
"""Range of the factors, and halvings of it."""
SECONDS, ASIDE, RESTS = 12.0, 0.1, 0.1
"""s of a flight, m from its place at the start on each axis, and share of the first quarter's
angular velocity that is rest."""


def swings_down(entry: Entry, latencies: Sequence[float]) -> list[bool]:
    """Return for each latency of commands (s) whether the vehicle comes to rest: whether the rms of
    its angular velocity in the last quarter of a flight is below RESTS times that of the first.
    """
    made = [
        door("Scenario")(
            truth=SimulatorParameters().model_copy(update={"command_latency": latency}),
            control=entry.control(),
            trajectory=FigureEight((0.0, 0.0, 1.5)),
            offset_w=(ASIDE, -ASIDE, ASIDE),
            true_state=True,
            whole_references=False,
            ground=False,
        )
        for latency in latencies
    ]
    flown = door("batch")(made, SECONDS, hover=SECONDS, history_rate=1.0 / PERIOD)
    turning = np.square(flown.history["truth"][:, :, 10:]).sum(axis=2)
    first, _, _, last = np.split(turning, 4, axis=1)
    rests = last.sum(axis=1) < RESTS**2 * first.sum(axis=1)  # NaN after a crash
    return [bool(one) for one in rests]


def delay_margin(entry: Entry) -> float:
    """Return the longest latency of commands (s) with which the vehicle still swings down, in steps
    of a tick; at most LONGEST.
    """
    latencies = [PERIOD * k for k in range(round(LONGEST / PERIOD) + 1)]
    down = swings_down(entry, latencies)
    return latencies[max(0, (*down, False).index(False) - 1)]


def scaled(entry: Entry, factor: float) -> Entry:
    """Return the entry with the gains of its law scaled, within their bounds."""
    store = ParameterStore(entry.control())
    settings = dict(entry.settings)
    own = f"{entry.law}."
    has_own_gains = entry.law == "pid_cascade"
    for one in store.descriptions():
        power = WEIGHTS.get(one.name, POWERS.get(one.unit, 0))
        is_gain = one.name.startswith(own) or (not has_own_gains and one.name.startswith(SHARED))
        if is_gain and power:
            value = float(store.get(one.name)) * factor**power
            settings[one.name] = float(np.clip(value, one.minimum, one.maximum))
    return replace(entry, settings=settings)


def at_margin(entry: Entry, margin: float) -> tuple[Entry, float]:
    """Return the entry with the largest gains with which it tolerates a latency (s), and the factor
    of its gains.

    Raises UsageError for a law of a file, whose gains are not known, and for one that does not
    tolerate it at all.
    """
    if entry.own:
        raise UsageError(
            f"--equal-margin: {entry.name} is of a file, whose gains the arena does not know; "
            "leave it out of --laws"
        )
    low, high = math.log(SMALLEST), math.log(LARGEST)
    if not swings_down(scaled(entry, SMALLEST), [margin])[0]:
        raise UsageError(
            f"--equal-margin: {entry.name} with half its bandwidth does not tolerate "
            f"{1e3 * margin:.0f} ms; leave it out of --laws"
        )
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        if swings_down(scaled(entry, math.exp(middle)), [margin])[0]:
            low = middle
        else:
            high = middle
    return scaled(entry, math.exp(low)), math.exp(low)


def at_equal_margin(entries: Sequence[Entry]) -> tuple[list[Entry], str]:
    """Return the entries at the delay margin of the first, which stays as it is, and a line about
    it.
    """
    first, *others = entries
    margin = delay_margin(first)
    made = [at_margin(one, margin) for one in others]
    told = ", ".join(f"{one.name} × {factor:.2f}" for one, factor in made)
    return [first, *(one for one, _ in made)], (
        f"at the delay margin of {first.name}, {1e3 * margin:.0f} ms, with bandwidths {told}"
    )
