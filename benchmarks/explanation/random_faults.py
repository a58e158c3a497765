"""Faults that are drawn at random from the library: which, how large, when, and two at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bearing_sim.faults import tracker
from bearing_sim.faults.fault import Fault
from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import ParameterStore
from vehicle.simulator.faults import table

DECLARED: dict[str, type[Fault]] = {**table.CATALOGUE.faults, **tracker.CATALOGUE.faults}
"""Faults of the vehicle, the world and the tracker; those of bearings need a flight on them."""
MOVED: dict[str, tuple[float, float]] = {
    "simulator.payload": (0.05, 0.4),
    "simulator.wind_x": (-5.0, 5.0),
    "simulator.gust": (0.5, 4.0),
    "simulator.push_x": (-3.0, 3.0),
    "simulator.push_z": (-3.0, 3.0),
    "simulator.thrust_efficiency": (0.8, 1.15),
    "simulator.vibration": (1.0, 8.0),
    "simulator.lost_samples": (0.01, 0.3),
    "simulator.corrupted_bytes": (0.001, 0.03),
    "tracker.delay": (0.02, 0.2),
    "tracker.drop_out": (0.1, 1.0),
    "tracker.outliers": (0.01, 0.4),
    "tracker.rate": (5.0, 60.0),
    "tracker.position_noise": (0.002, 0.03),
    "tracker.attitude_noise": (0.3, 3.0),
}
"""Parameters that are moved like a fault, and the range of their values."""
NEUTRAL = {"factor": 1.0, "gain": 1.0}
"""Value of a parameter of a fault with which it would do nothing, where that is not 0."""
PLACES = ("world.updraught", "world.wake", "world.wall")
"""Faults whose x, y and at are places, which are moved by some decimetres instead."""
SMALLEST = {"imu.clip": {"accelerometer": 11.0}}
"""Values below which a sensor would be none: an accelerometer has to hold the weight."""
LEAST, MOST = 0.3, 5.0
"""Smallest and largest size over that of the declaration."""
SEVERAL, NONE = 0.35, 0.1
"""Share of flights with two faults, and without any."""


@dataclass(frozen=True)
class Drawn:
    """A fault with its values and schedule.

    Attributes:
        name: of the fault or parameter. text: as `faults` takes it.
    """

    name: str
    text: str

    @property
    def home(self) -> str:
        """Return the parameter that takes it."""
        return "tracker.faults" if self.name.startswith("tracker.") else "simulator.faults"


def draw(chance: np.random.Generator, first: float, last: float) -> tuple[Drawn, ...]:
    """Return none, one or two faults, of two names.

    Args:
        first, last: s, when a fault comes on at the earliest and at the latest.
    """
    names = [*DECLARED, *MOVED]
    kind = chance.random()
    count = 0 if kind < NONE else 2 if kind > 1.0 - SEVERAL else 1
    found = []
    for name in chance.choice(names, count, replace=False).tolist():
        values = _moved(name, chance) if name in MOVED else _values(name, chance)
        found.append(Drawn(name, f"{name} {values} {_schedule(chance, first, last)}"))
    return tuple(found)


def settings(faults: tuple[Drawn, ...]) -> dict[str, str]:
    """Return the parameters that set these faults."""
    found: dict[str, list[str]] = {}
    for one in faults:
        found.setdefault(one.home, []).append(one.text)
    return {home: "; ".join(texts) for home, texts in found.items()}


def _moved(name: str, chance: np.random.Generator) -> str:
    value = float(chance.uniform(*MOVED[name]))
    return f"value={round(value) if name == 'tracker.rate' else round(value, 4)}"


def _values(name: str, chance: np.random.Generator) -> str:
    described = ParameterStore(DECLARED[name]()).descriptions()
    size = float(np.exp(chance.uniform(np.log(LEAST), np.log(MOST))))
    words = []
    for one in described:
        if one.choices:
            words.append(f"{one.name}={chance.choice(list(one.choices))}")
        elif name in PLACES and one.name in ("x", "y", "at"):
            words.append(f"{one.name}={float(one.default) + chance.normal(0.0, 0.3):.2f}")
        else:
            value = _sized(one, described, size, chance)
            value = max(value, SMALLEST.get(name, {}).get(one.name, value))
            words.append(f"{one.name}={value:.5g}")
    return " ".join(words)


def _sized(
    one: ParameterDescription,
    described: Sequence[ParameterDescription],
    size: float,
    chance: np.random.Generator,
) -> float:
    neutral = NEUTRAL.get(one.name, 0.0)
    usual = float(one.default) - neutral
    if usual == 0.0 and chance.random() < 0.4:  # another axis than the one that is declared
        alike = [d for d in described if d.unit == one.unit and not d.choices]
        usual = max(abs(float(d.default)) for d in alike)
    sign = -1.0 if chance.random() < 0.5 else 1.0
    if one.minimum is not None and neutral - abs(usual) * size < one.minimum:
        sign = 1.0 if usual > 0.0 or one.minimum >= neutral else sign
    value = neutral + sign * usual * size
    if one.type == "int":
        value = float(round(value))
    low = -np.inf if one.minimum is None else one.minimum
    high = np.inf if one.maximum is None else one.maximum
    return float(np.clip(value, low, high))


def _schedule(chance: np.random.Generator, first: float, last: float) -> str:
    begins = f"from={chance.uniform(first, last):.2f}"
    kind = chance.random()
    if kind < 0.4:
        return begins
    if kind < 0.65:
        return f"{begins} for={np.exp(chance.uniform(np.log(0.2), np.log(6.0))):.2f}"
    if kind < 0.8:
        return f"{begins} ramp={chance.uniform(0.5, 5.0):.2f}"
    if kind < 0.9:
        every = chance.uniform(2.0, 8.0)
        return f"{begins} every={every:.2f} for={chance.uniform(0.1, 0.5) * every:.2f}"
    spell = np.exp(chance.uniform(np.log(0.02), np.log(2.0)))
    return f"{begins} share={chance.uniform(0.02, 0.5):.2f} spell={spell:.3f}"
