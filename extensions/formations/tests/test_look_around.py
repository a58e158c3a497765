"""The path of the experiment `look_around`, flown by a point that follows it."""

from __future__ import annotations

import numpy as np
import pytest

from extensions.formations.look_around import RATE, Planned, Straight
from extensions.formations.mathematics.active_sensing import Room
from quadlab.__main__ import main
from quadrotor.records import Array

ROOM = Room((0.0, 0.0, 1.0), 0.8, 0.5, 1.9, 0.5)


def _flown(path: Planned | Straight, seconds: float) -> tuple[Array, Array]:
    """Return places and velocities (N, 3) of a vehicle that flies a path exactly."""
    here, places, velocities = np.array(ROOM.centre_w), [], []
    for _ in range(round(seconds * RATE)):
        here, velocity = path.at(here)
        places.append(here)
        velocities.append(velocity)
    return np.array(places), np.array(velocities)


@pytest.mark.parametrize("path", [Planned(ROOM, "paper"), Straight(ROOM)])
def test_the_path_is_smooth_and_keeps_to_its_room(path: Planned | Straight) -> None:
    places, velocities = _flown(path, 8.0)
    away = places - np.array(ROOM.centre_w)
    assert np.linalg.norm(away, axis=1).max() <= ROOM.radius + 1e-6
    assert np.linalg.norm(away, axis=1).max() > 0.5
    assert places[:, 2].min() >= ROOM.lowest - 1e-6
    assert places[:, 2].max() <= ROOM.highest + 1e-6
    assert np.linalg.norm(velocities, axis=1).max() <= ROOM.speed + 1e-6
    by_differences = np.diff(places, axis=0) * RATE
    assert np.abs(by_differences - velocities[:-1]).max() < 0.05


def test_the_planned_path_goes_down_to_beacons_on_the_ground() -> None:
    places, _ = _flown(Planned(ROOM, "paper"), 8.0)
    assert places[-50:, 2].mean() < 0.9


def test_a_manoeuvre_of_the_experiment_bearings_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["fly", "look_around", "--set", "experiment.manoeuvre=sticks"]) == 2
    told = capsys.readouterr().err.strip()
    assert "experiment.manoeuvre=sticks: look_around flies its own; choose" in told
    assert "\n" not in told
