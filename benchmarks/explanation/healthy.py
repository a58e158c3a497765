"""Flights without a fault, of all kinds: does the explanation name anything?

    python -m benchmarks healthy --seed 70001 --flights 200
    python -m benchmarks.explanation.healthy --seed 70017 --flights 1 --keep DIR

Simulated time, as by `quadlab fly`: experiment, world, gain set and estimator follow from the seed.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from console.evaluation.findings import explain_log
from quadlab.simulated.experiment import chosen, fly
from quadrotor.errors import QuadlabError

FLIGHTS, FIRST_SEED = 200, 70001
EXPERIMENTS: dict[str, tuple[str, ...]] = {
    "hover": (),
    "figure_eight": (),
    "figure_eight, one lap": (
        "experiment.laps=rest_to_rest",
        "experiment.yaw_amplitude=0.2",
        "behavior.trajectory_acceleration_max=5.2",
    ),
    "mass": (),
    "inertia": (),
    "drag": (),
    "tracker_delay": (),
    "bearings": (),
}
"""Experiments, with their settings."""
SETTINGS: dict[str, tuple[str, ...]] = {
    "standard": (),
    "observer": ("control.preset=observer",),
    "stiff_observer": ("control.preset=stiff_observer",),
    "error_state": ("estimation.estimator=error_state",),
}
"""Settings that are flown with; the first one twice as often."""
OWN_SETTINGS = ("bearings", "inertia")
"""Experiments that are flown with the first settings alone."""
WORLDS = ("clean", "rough")


@dataclass(frozen=True)
class Healthy:
    """One flight.

    Attributes:
        named: kinds of finding, the heaviest first. claims: what they say.
        ended: why it ended early, empty if it did not.
    """

    seed: int
    experiment: str
    world: str
    settings: str
    named: list[str]
    claims: list[str]
    ended: str = ""


def condition(seed: int) -> tuple[str, str, str]:
    """Return experiment, world and settings of a seed."""
    chance = np.random.default_rng((seed, 44))
    name = str(chance.choice(list(EXPERIMENTS)))
    world, settings = str(chance.choice(WORLDS)), list(SETTINGS)
    usual = name in OWN_SETTINGS
    return name, world, settings[0] if usual else str(chance.choice([settings[0], *settings]))


def fly_one(seed: int, keep: Path | None = None) -> Healthy:
    """Fly once and explain the log, which stays in the folder `keep`."""
    name, world, settings = condition(seed)
    words = [f"simulator.preset={world}", *EXPERIMENTS[name], *SETTINGS[settings]]
    with tempfile.TemporaryDirectory() as folder:
        out, ended = keep or Path(folder), ""
        try:
            path = fly(chosen(name.partition(",")[0]), seed=seed, words=words, out=out).path
        except QuadlabError as error:
            ended = str(error)
            path = max(out.glob("*.mcap"), key=lambda one: one.stat().st_mtime)
        found = explain_log(path)
    kinds, claims = [one.kind for one in found], [one.claim for one in found]
    return Healthy(seed, name, world, settings, kinds, claims, ended)


def run(size: Size = Size.FULL, flights: int = FLIGHTS, seed: int = FIRST_SEED) -> Report:
    """Run the benchmark for `python -m benchmarks`, from the first seed on."""
    return report([fly_one(seed + k) for k in range(size.of(flights, 12, 1))])


def report(flown: Sequence[Healthy]) -> Report:
    """Return one row for each experiment and world."""
    found = Report(
        "healthy",
        "Causes that are named although nothing is wrong",
        [f"{len(flown)} flights in simulated time: experiments, worlds, gain sets and estimators"],
    )
    for name, world in sorted({(one.experiment, one.world) for one in flown}):
        mine = [one for one in flown if (one.experiment, one.world) == (name, world)]
        named = Counter(", ".join(one.named) for one in mine if one.named)
        figures: dict[str, float | str] = {
            "flights": len(mine),
            "nothing named": sum(not one.named for one in mine),
            "named": "; ".join(f"{kinds} {n}" for kinds, n in named.most_common()),
        }
        found.rows.append(Row(f"{name}, {world}", figures))
    for one in flown:
        if one.named or one.ended:
            found.notes.append(
                f"seed {one.seed}, {one.experiment}, {one.world}, {one.settings}: "
                f"{' '.join(one.claims)} {one.ended}"
            )
    share = sum(not one.named for one in flown) / len(flown)
    text = f"flights in which nothing is named, share of {len(flown)}"
    found.targets.append(Target(text, share, 0.95, at_most=False))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--flights", type=int, default=8)
    parser.add_argument("--rows", type=Path, help="file that gets a line of JSON for each flight")
    parser.add_argument("--keep", type=Path, help="folder in which the logs stay")
    words = parser.parse_args()
    flown = []
    for seed in range(words.seed, words.seed + words.flights):
        flown.append(fly_one(seed, words.keep))
        if words.rows:
            with words.rows.open("a") as file:
                file.write(json.dumps(asdict(flown[-1])) + "\n")
    print(report(flown).as_markdown())


if __name__ == "__main__":
    main()
