"""The `--set` words of `quadlab up`, checked and divided among its child processes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from quadlab.settings import (
    offer_plugins,
    parse_board_options,
    parse_settings,
    split_faults,
    vehicle_parameters,
)
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from quadrotor.parameter_description import ParameterValue

SIMULATOR, TRACKER, PRESET = "simulator.", "tracker.", "preset="


class ChildWords(NamedTuple):
    """The `--set` words of the child processes, and the values that the vehicle gets."""

    vehicle: list[str]
    simulator: list[str]
    station: list[str]
    values: dict[str, ParameterValue]


def child_words(
    board: str, settings: Sequence[str], data: Path, tracker: str, is_served: bool
) -> ChildWords:
    """Return the words of each process. Raises UsageError for a word that none of them takes.

    Args:
        data: folder of the data, which may have plugins with parameters.
        tracker: words of `quadlab tracker`, empty for the station's simulated tracker.
        is_served: whether the simulator serves this tracker's poses.
    """
    words, _ = parse_board_options(board, settings)
    of_board = set_words([word for word in settings if word not in words])
    if not words:
        return ChildWords(of_board, of_board, [], {})
    # Imported only for their names and bounds: a plain start saves these 100 MB.
    from vehicle.simulator.parameters import SimulatorParameters

    words, station = split_faults(words)
    vehicle = [word for word in words if not word.startswith(SIMULATOR)]
    simulator = [word.removeprefix(SIMULATOR) for word in words if word.startswith(SIMULATOR)]
    vehicle = identified(simulator) + vehicle  # which counts where both set a value
    offer_plugins(data)
    values = parse_settings(vehicle_parameters(board), vehicle)
    parse_settings(SimulatorParameters(), simulator, SIMULATOR)
    if station:
        from console.parameters.station import station_parameters

        parse_settings(station_parameters(), station)
    if tracker and (served := [word for word in station if word.startswith(TRACKER)]):
        if not is_served:
            raise UsageError(
                f"--set faults={served[0].partition('=')[2]}: --tracker {tracker!r} turns the "
                "simulated tracker off; leave one of them out"
            )
        station = [word for word in station if word not in served]
        simulator += served
    of_simulator = of_board + set_words(simulator)
    return ChildWords(of_board + set_words(vehicle), of_simulator, set_words(station), values)


def identified(simulator: Sequence[str]) -> list[str]:
    """Return the words for the vehicle of what is identified in the world that these words name."""
    from vehicle.simulator.presets import IDENTIFIED

    worlds = [word.removeprefix(PRESET) for word in simulator if word.startswith(PRESET)]
    found = IDENTIFIED.get(worlds[-1], {}) if worlds else {}
    return [f"{name}={value}" for name, value in found.items()]


def set_words(settings: Sequence[str]) -> list[str]:
    """Return the settings, each as an option `--set`."""
    return [word for setting in settings for word in ("--set", setting)]
