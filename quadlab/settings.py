"""`--set name=value` words, checked against the parameters that they set.

`control.preset=NAME` and `estimation.preset=NAME` stand for the gains of a named set, and
`simulator.preset=rough` for a simulated world as rough as a real one; later words change single
values. `faults=TEXT` stands for the faults of simulator, tracker and bearings together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from quadrotor.errors import MeasurementError, OutOfBoundsError, ParameterError, UsageError

if TYPE_CHECKING:
    from quadrotor.parameter_description import ParameterValue
    from quadrotor.parameters import Parameters, ParameterStore
    from vehicle.parameters import VehicleParameters


def _control_preset(name: str) -> dict[str, ParameterValue]:
    """Return all gains of the named set, by parameter name. Raises ParameterError."""
    from control.presets import preset_values

    return preset_values(name)


def _estimation_preset(name: str) -> dict[str, ParameterValue]:
    """Return the gains of the named set, by parameter name. Raises ParameterError."""
    from estimation.parameters import PRESETS

    if name not in PRESETS:
        raise OutOfBoundsError(f"no gain set is called {name!r}: there are {', '.join(PRESETS)}")
    return {f"estimation.{k}": v for k, v in PRESETS[name].items()}


def _simulator_preset(name: str) -> dict[str, ParameterValue]:
    """Return the values of the named world, and what is identified in it, by parameter name.
    Raises ParameterError.
    """
    from vehicle.simulator.presets import IDENTIFIED, preset_values

    world = {f"simulator.{k}": v for k, v in preset_values(name).items()}
    return world | IDENTIFIED.get(name, {})


def _faults(text: str) -> dict[str, ParameterValue]:
    """Return the faults of simulator, tracker and bearings, by parameter name, of one text."""
    from bearing_sim.faults.fault import by_home

    return {**by_home(text)}


BOARD = "board."
"""Prefix of the names of a board's options."""
SETS = {
    "control.preset": _control_preset,
    "estimation.preset": _estimation_preset,
    "simulator.preset": _simulator_preset,
    "faults": _faults,
}
"""Options that set several parameters."""


def offer_plugins(data: Path) -> None:
    """Make what the plugins of the data folder add part of the vehicle's parameters."""
    from vehicle.estimators import offer
    from vehicle.processes.config import PLUGINS

    offer.offer_plugins(data / PLUGINS)


def check_laws(values: Mapping[str, ParameterValue], data: Path) -> None:
    """Check that the user's own control laws, behavior and sensors that these parameters name exist
    in the data folder.

    Raises RefusedError when one is not available.
    """
    if "behavior.plugin" in values:
        from control.behaviors.behavior import ExternalReference
        from vehicle.behaviors.behaviors import PARAMETER, OwnBehaviors
        from vehicle.processes.config import PLUGINS

        OwnBehaviors(data / PLUGINS, False, ExternalReference(), str(values[PARAMETER]))
    if "estimation.sensors" in values:
        from vehicle.processes.config import PLUGINS
        from vehicle.sensors.sensors import PARAMETER as SENSORS
        from vehicle.sensors.sensors import OwnSensors

        OwnSensors(data / PLUGINS, False, str(values[SENSORS]))
    if not values.keys() & {"control.law", "control.shadow_law"}:
        return
    from control.parameters import GEOMETRIC, NONE
    from vehicle.laws.laws import LAW, SHADOW_LAW, Laws
    from vehicle.processes.config import PLUGINS

    law, shadow = values.get(LAW, GEOMETRIC), values.get(SHADOW_LAW, NONE)
    Laws(data / PLUGINS).check(str(law), str(shadow))


def vehicle_parameters(board: str) -> VehicleParameters:
    """Return the parameters of a vehicle with this board. Raises UsageError."""
    from quadrotor.parameters import ParameterStore
    from vehicle.boards.kind import find_kind
    from vehicle.parameters import new_parameters

    parameters = new_parameters()
    ParameterStore(parameters).preset(find_kind(board).traits.parameters)
    return parameters


def parse_board_options(
    board: str, words: Sequence[str]
) -> tuple[list[str], dict[str, ParameterValue]]:
    """Return (the words that are not `board.NAME=VALUE`, the values of those that are).

    Raises UsageError for values that this kind of board does not allow.
    """
    from vehicle.boards.kind import find_kind

    ours = [word.removeprefix(BOARD) for word in words if word.startswith(BOARD)]
    others = [word for word in words if not word.startswith(BOARD)]
    options = find_kind(board).configured({})
    for word in ours:
        if word.startswith("firmware.") and hasattr(options, "firmware"):
            raise UsageError(
                f"--set {BOARD}{word}: this is known once the board has been read; at the start "
                f'it is set with --set "board.parameters={word.removeprefix("firmware.")}"'
            )
    if ours and options is None:
        raise UsageError(f"--set {BOARD}{ours[0]}: board {board} has no options")
    return others, parse_settings(options, ours, BOARD) if ours and options else {}


def split_faults(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words with `faults=TEXT` as `simulator.faults=TEXT`, and those for the station."""
    others: list[str] = []
    of_station: list[str] = []
    for word in words:
        name, _, text = word.partition("=")
        if name != "faults":
            others.append(word)
            continue
        for home, part in _faults(text).items():
            (others if home.startswith("simulator.") else of_station).append(f"{home}={part}")
    return others, of_station


def parse_settings(
    parameters: Parameters, words: Sequence[str], prefix: str = ""
) -> dict[str, ParameterValue]:
    """Apply `name=value` words to `parameters`; return the values that were set.

    Args:
        prefix: what precedes each name on the command line, for messages.

    Raises UsageError with the word, what is allowed and what to try.
    """
    from quadrotor.parameters import ParameterStore
    from vehicle.parameters import VehicleParameters, check_pairs
    from vehicle.simulator.parameters import SimulatorParameters

    store = ParameterStore(parameters)
    values: dict[str, ParameterValue] = {}
    sets = SETS if isinstance(parameters, VehicleParameters) else {}
    if isinstance(parameters, SimulatorParameters):
        from vehicle.simulator.presets import preset_values

        sets = {"preset": preset_values}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            raise UsageError(
                f"--set {prefix}{word}: write it as name=value, like {store.names[0]}=1"
            )
        try:
            values |= setting(store, sets, name, text)
        except ParameterError as error:
            raise UsageError(f"--set {prefix}{word}: {error}") from None
    try:
        store.preset(values)
    except ParameterError as error:  # beyond the descriptions, like a text that is not a layout
        raise UsageError(f"--set: {error}") from None
    if values and isinstance(parameters, VehicleParameters):
        try:
            check_pairs(store.values())
        except ParameterError as error:
            raise UsageError(str(error)) from None
    return values


def setting(
    store: ParameterStore,
    sets: Mapping[str, Callable[[str], dict[str, ParameterValue]]],
    name: str,
    text: str,
) -> dict[str, ParameterValue]:
    """Return the values for which one `name=text` stands. Raises ParameterError."""
    from quadrotor.parameter_description import parse_text

    if name in sets:
        return sets[name](text)
    return {name: parse_text(store.description(name), text)}


def beacon_words(file: Path | None) -> list[str]:
    """Return the `--set` words for the file's layout of beacons. Raises UsageError with line and
    column.
    """
    if file is None:
        return []
    from bearing_sim.beacon_file import load_beacons
    from bearing_sim.beacons import format_layout

    try:
        return [f"bearings.layout={format_layout(load_beacons(file))}"]
    except MeasurementError as error:
        raise UsageError(f"--beacons: {error}") from None
