"""The kind of board that a Crazyflie is, and its options as parameters of the vehicle."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from extensions.crazyflie import NAME as CRAZYFLIE
from extensions.crazyflie.board.options import CrazyflieOptions
from quadrotor.errors import OutOfBoundsError, UnknownParameterError
from quadrotor.parameters import ParameterStore
from vehicle.boards.board import CommandKind
from vehicle.boards.kind import MIKROKOPTER, find_kind
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


def test_it_takes_rates_at_100_hz_and_is_asked() -> None:
    kind = find_kind(CRAZYFLIE)
    assert kind.traits.takes[0] is CommandKind.RATES
    assert (kind.options, kind.rate, kind.is_asked) == (CrazyflieOptions, 100, True)


def test_options_that_apply_at_once_change_in_the_tree_that_the_board_reads() -> None:
    parameters = tree(CRAZYFLIE, pose_rate=20.0)
    store = ParameterStore(parameters)
    assert store.get("board.pose_rate") == 20.0
    store.set({"board.landing_thrust": 0.25})
    assert parameters.board.landing_thrust == 0.25  # type: ignore[attr-defined]
    with pytest.raises(OutOfBoundsError, match=r"board\.pose_rate"):
        store.set({"board.pose_rate": 500.0})
    with pytest.raises(OutOfBoundsError, match=r"board\.parameters has 'kp'; give GROUP"):
        store.set({"board.parameters": "kp"})
    assert "stabilizer" in str(store.get("board.parameters"))


def test_a_board_without_options_adds_no_parameters() -> None:
    tree(CRAZYFLIE)
    with pytest.raises(UnknownParameterError):
        ParameterStore(tree(MIKROKOPTER)).get("board.pose_rate")


def test_its_model_can_hover_and_a_mass_that_cannot_is_refused() -> None:
    store = ParameterStore(new_parameters())
    store.preset(find_kind(CRAZYFLIE).traits.parameters)
    check_pairs(store.values())
    check_hover(store.values())
    with pytest.raises(OutOfBoundsError, match=r"model\.mass = 0.5 kg cannot hover: "):
        check_hover(store.values() | {"model.mass": 0.5})
