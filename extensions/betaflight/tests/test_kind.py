"""The kind of board that Betaflight is, and its options as parameters of the vehicle."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from extensions.betaflight import NAME as BETAFLIGHT
from extensions.betaflight.board.options import BetaflightOptions
from quadrotor.errors import OutOfBoundsError, ReadOnlyError
from quadrotor.parameters import ParameterStore
from vehicle.boards.board import CommandKind
from vehicle.boards.kind import find_kind
from vehicle.boards.offered import offer
from vehicle.parameters import VehicleParameters, check_hover, check_pairs, new_parameters


@pytest.fixture(autouse=True)
def none_offered() -> Iterator[None]:
    yield
    offer(None, live=False)


def tree(board: str, **values: float) -> VehicleParameters:
    kind = find_kind(board)
    offer(kind.configured(values), live=kind.live)
    return new_parameters()


def test_it_takes_rates_at_250_hz() -> None:
    kind = find_kind(BETAFLIGHT)
    assert kind.traits.takes[0] is CommandKind.RATES
    assert (kind.options, kind.rate) == (BetaflightOptions, 250)


def test_the_option_level_moves_where_the_law_ends() -> None:
    kind = find_kind("betaflight")
    rates = kind.traits_with(kind.configured({}))
    assert rates == kind.traits
    angles = kind.traits_with(kind.configured({"level": "angles", "angle_gain": 6.0}))
    assert angles.takes == (CommandKind.ANGLES, CommandKind.RATES)
    assert angles.angle_gain == 6.0


def test_options_that_describe_the_boards_settings_can_only_be_read() -> None:
    store = ParameterStore(tree(BETAFLIGHT, rate_max=300.0))
    assert store.get("board.rate_max") == 300.0
    assert store.description("board.rate_max").unit == "°/s"
    with pytest.raises(ReadOnlyError, match=r"set it at the start with --set board\.rate_max="):
        store.set({"board.rate_max": 400.0})


def test_its_model_can_hover_and_a_mass_that_cannot_is_refused() -> None:
    store = ParameterStore(new_parameters())
    store.preset(find_kind(BETAFLIGHT).traits.parameters)
    check_pairs(store.values())
    check_hover(store.values())
    with pytest.raises(OutOfBoundsError, match=r"model\.mass = 0.03 kg cannot hover: "):
        check_hover(store.values() | {"model.mass": 0.03})
