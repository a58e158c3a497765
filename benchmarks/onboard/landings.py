"""Simulate landings that are disturbed, and look for touch-downs that were none.

    python -m benchmarks landings [--quick]
    python -m benchmarks.onboard.landings [--count 1000] [--board crazyflie] [--behavior land]

One flight hovers, and forks once for each landing: the copy lands with a disturbance of its own,
drawn from the seed, at any moment of the descent, and on a floor of its own: level or tilted by up
to 10 degrees, with ground effect or without. A disturbance is stated for the paper's vehicle of
1.308 kg, and is as much smaller for a lighter one. In the behavior `silent` the flight process is
stopped, and the board lands.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.flights.watched_flight import TOUCHING, WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from benchmarks.onboard.in_a_copy import in_a_copy
from extensions.crazyflie import NAME as CRAZYFLIE
from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from vehicle.boards.kind import MIKROKOPTER
from vehicle.simulator.plant import FOOT, FOOT_SHARE

KINDS = ("none", "push", "step", "payload off", "payload on", "updraught", "thrust", "wind")
"""A force for some 0.4 s or from then on, a released or added payload, moving air, and a change of
what the motors give."""
LAND, EMERGENCY_LANDING, SILENT = "land", "emergency_landing", "silent"
DRAG = 0.25
"""N s/m, of the paper's vehicle, with which moving air carries it."""
MASS, CRAZYFLIE_MASS = 1.308, 0.034
SLOPE = 10.0
"""Largest slope of the floor, in degrees."""
DOWN = 0.03
"""Largest height above the floor, in m, at which motors may be switched off: that of one foot."""
RECOGNISED, HARD = 0.6, 1.0
"""Longest time, in s, from the last contact to recognition, and largest impact, in m/s, to
reach."""
LAST = 3.5
"""Latest start of a disturbance, in s after the command to land from 1 m."""
ON = 30.0
"""Duration, in s, of a disturbance that lasts beyond the landing."""


@dataclass(frozen=True)
class Disturbance:
    """One change of the simulated world in a landing.

    Attributes:
        kind: of KINDS.
        change: parameters of the simulator from `at` on.
        at, lasting: s after the command, and s.
        before: parameters of the simulator from before the landing on.
    """

    kind: str
    change: dict[str, float | str]
    at: float = 0.0
    lasting: float = ON
    before: dict[str, float] | None = None


@dataclass
class Landing:
    """The end of one landing; times in s after the command, None for never.

    Attributes:
        contact: first contact with the ground; after a bounce, that which lasted until `told`.
        told: end of the landing by the vehicle itself. height: m, at that moment.
        impact: m/s, the hardest.
        refuted: number of presumed touch-downs that were found to be none.
        doubted: whether the barometer, which is sound, was not believed.
        what: behavior, disturbance and floor, in words.
    """

    kind: str
    contact: float | None = None
    told: float | None = None
    height: float = 0.0
    impact: float = 0.0
    refuted: int = 0
    doubted: bool = False
    what: str = ""

    @property
    def is_in_the_air(self) -> bool:
        """Return whether the vehicle took the air for the ground."""
        return self.height > DOWN

    @property
    def lasted(self) -> float:
        """Return the time, in s, from contact to recognition; NaN without both."""
        if self.told is None or self.contact is None or self.is_in_the_air:
            return math.nan
        return self.told - self.contact

    @property
    def is_bad(self) -> bool:
        """Return whether the landing misses one of the limits."""
        missed = self.is_in_the_air or self.told is None or self.impact > HARD
        return missed or self.lasted > RECOGNISED


def disturbance(kind: str, chance: np.random.Generator, scale: float = 1.0) -> Disturbance:
    """Return a random disturbance of a kind; forces and masses are multiplied by `scale`."""
    at = float(chance.uniform(0.0, LAST))
    lasting = float(chance.choice([0.3, 0.5, 1.0, 2.0, ON]))
    force, payload = scale * chance.uniform(-3.0, 3.0), scale * chance.uniform(0.05, 0.4)
    if kind == "push":
        return Disturbance(kind, {"push_z": force}, at, float(chance.uniform(0.2, 0.6)))
    if kind == "step":
        return Disturbance(kind, {"push_z": force}, at)
    if kind == "payload off":
        return Disturbance(kind, {"payload": 0.0}, at, before={"payload": payload})
    if kind == "payload on":
        return Disturbance(kind, {"payload": payload}, at)
    if kind == "updraught":
        return Disturbance(kind, {"wind_z": float(chance.uniform(1.0, 8.0))}, at, lasting)
    if kind == "thrust":
        return Disturbance(kind, {"thrust_efficiency": float(chance.uniform(0.85, 1.15))}, at)
    if kind == "wind":
        along, up = chance.uniform(-4.0, 4.0), chance.uniform(-8.0, 8.0)
        return Disturbance(kind, {"wind_x": float(along), "wind_z": float(up)}, at, lasting)
    return Disturbance(kind, {}, at)


def hovering(
    seed: int, board: str = MIKROKOPTER, settings: dict[str, ParameterValue] | None = None
) -> WatchedFlight:
    """Return a flight that hovers at 1 m."""
    drag = DRAG * _scale(board)
    return WatchedFlight(seed, {"simulator.drag": drag, **(settings or {})}, board=board).hover()


def land(
    flight: WatchedFlight,
    disturbed: Disturbance,
    behavior: str = LAND,
    floor: dict[str, float] | None = None,
) -> Landing:
    """Land with a disturbance, in a copy of the flight, which itself is unchanged.

    Args:
        floor: parameters of the simulator from before the landing on.
    """
    before = {**(floor or {}), **(disturbed.before or {})}
    return Landing(**in_a_copy(lambda: vars(_land(flight, disturbed, behavior, before))))


def _land(
    flight: WatchedFlight, disturbed: Disturbance, behavior: str, before: dict[str, float]
) -> Landing:
    if before:
        flight.disturb(**before)
        flight.wait(1.5)
    calm: dict[str, Any] = {
        name: getattr(flight.parameters.simulator, name) for name in disturbed.change
    }
    found, begun_ns = Landing(disturbed.kind), flight.robot.stamp_ns
    slope = math.radians(flight.parameters.simulator.ground_slope)
    due = [(disturbed.at, disturbed.change), (disturbed.at + disturbed.lasting, calm)]
    foot = min(FOOT, FOOT_SHARE * flight.parameters.simulator.arm) * abs(math.sin(slope))
    flight.forget()
    if behavior == SILENT:
        flight.frozen = True
    else:
        flight.start(behavior)
    told = len(flight.events.texts)
    while (now := (flight.robot.stamp_ns - begun_ns) * 1e-9) < ON:
        if due and now >= due[0][0]:
            flight.disturb(**due.pop(0)[1])
        sinking = -float(flight.robot.truth["velocity_w"][0, 2])
        flight.advance()
        height = _height(flight, slope)
        if found.told is None and height > foot + TOUCHING:
            found.contact = None
        elif height < foot + TOUCHING:
            found.contact = now if found.contact is None else found.contact
            found.impact = max(found.impact, sinking)
        for text in flight.events.texts[told:]:
            found.refuted += text.startswith("not on the ground")
            found.doubted |= text.startswith("barometer and accelerometer disagree")
            if text == "touched down":
                found.told, found.height = now, height - foot
        if behavior == SILENT and found.told is None and has_stopped(flight):
            found.told, found.height = now, height - foot
        told = len(flight.events.texts)
        if found.told is not None and now > found.told + 1.0:
            break
    return found


def _height(flight: WatchedFlight, slope: float) -> float:
    """Return the height above the floor, m, along its normal."""
    x, _, z = flight.robot.truth["position_w"][0].tolist()
    return float(math.cos(slope) * z - math.sin(slope) * x)


def has_stopped(flight: WatchedFlight) -> bool:
    """Return whether the board has switched its motors off by itself."""
    return flight.robot.firmware.motor_state not in (MotorState.ON, MotorState.EMERGENCY)


def _scale(board: str) -> float:
    return CRAZYFLIE_MASS / MASS if board == CRAZYFLIE else 1.0


def fly_all(seed: int, count: int, board: str, behaviors: Sequence[str]) -> list[Landing]:
    """Return `count` landings from one flight, of all kinds and behaviors in turns."""
    chance, flight = np.random.default_rng(seed), hovering(seed, board)
    landings = []
    for k in range(count):
        disturbed = disturbance(KINDS[k % len(KINDS)], chance, _scale(board))
        slope = float(chance.choice([0.0, chance.uniform(-SLOPE, SLOPE)]))
        floor = {"ground_slope": slope, "ground_effect": float(chance.choice([0.0, 1.0]))}
        behavior = behaviors[k // len(KINDS) % len(behaviors)]
        landings.append(land(flight, disturbed, behavior, floor))
        landings[-1].what = f"seed {seed}, landing {k}, {behavior}, {disturbed}, {floor}"
    return landings


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    flights, count = size.of((8, 96), (2, 48), (1, len(KINDS)))
    behaviors = size.some((LAND, EMERGENCY_LANDING, SILENT))
    landings = [
        one
        for seed in range(1, flights + 1)
        for one in fly_all(seed, count, MIKROKOPTER, behaviors)
    ]
    return report(landings, MIKROKOPTER, behaviors)


def report(landings: Sequence[Landing], board: str, behaviors: Sequence[str]) -> Report:
    """Return the table: one row for each kind of disturbance."""
    found = Report(
        "landings",
        "Landings with disturbances",
        [
            f"{len(landings)} landings from 1 m, {' and '.join(behaviors)}, {board}",
            f"a touch-down told above {DOWN:g} m is one in the air",
            f"floor level or tilted by up to {SLOPE:g}°, with ground effect in every other one",
            "recognised: from the contact that lasted",
        ],
    )
    for kind in KINDS:
        of_kind = [one for one in landings if one.kind == kind]
        if of_kind:
            found.rows.append(Row(kind, _figures(of_kind)))
    found.targets = [
        Target("touch-downs in the air", sum(one.is_in_the_air for one in landings), 0),
        Target("landings without an end", sum(one.told is None for one in landings), 0),
        Target("hardest touch-down, m/s", max(one.impact for one in landings), HARD),
        Target("recognised, s, median", statistics.median(_times(landings)), RECOGNISED),
        Target("recognised, s, 99 %", float(np.quantile(_times(landings), 0.99)), RECOGNISED),
        Target("recognised later", sum(one.lasted > RECOGNISED for one in landings), 0),
    ]
    found.notes = [
        f"{one.what}: {one.impact:.2f} m/s, recognised after {one.lasted:.2f} s, "
        f"{one.height:.2f} m above the floor then"
        for one in landings
        if one.is_bad
    ]
    return found


def _figures(landings: Sequence[Landing]) -> dict[str, float | str]:
    times = _times(landings)
    return {
        "landings": len(landings),
        "in the air": sum(one.is_in_the_air for one in landings),
        "refuted": sum(one.refuted for one in landings),
        "barometer doubted": sum(one.doubted for one in landings),
        "impact, m/s, median": statistics.median(one.impact for one in landings),
        "hardest": max(one.impact for one in landings),
        "recognised, s, median": statistics.median(times),
        "95 %": float(np.quantile(times, 0.95)),
    }


def _times(landings: Sequence[Landing]) -> list[float]:
    """Return the times from contact to recognition; NaN alone when there is none."""
    return [one.lasted for one in landings if math.isfinite(one.lasted)] or [math.nan]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--board", default=MIKROKOPTER, choices=(MIKROKOPTER, CRAZYFLIE))
    parser.add_argument("--behavior", action="append")
    words = parser.parse_args()
    behaviors = words.behavior or [LAND]
    landings = fly_all(words.seed, words.count, words.board, behaviors)
    print(report(landings, words.board, behaviors).as_markdown())


if __name__ == "__main__":
    main()
