"""Options of the board in use as parameters of the vehicle."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from extensions.betaflight import NAME as BETAFLIGHT
from extensions.crazyflie import NAME as CRAZYFLIE
from quadrotor.errors import OutOfBoundsError, ReadOnlyError, UnknownParameterError
from quadrotor.parameters import ParameterStore
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.boards.offered import offer
from vehicle.parameters import VehicleParameters, new_parameters


@pytest.fixture(autouse=True)
def none_offered() -> Iterator[None]:
    yield
    offer(None, live=False)


def tree(board: str, **values: float) -> VehicleParameters:
    kind = find_kind(board)
    offer(kind.configured(values), live=kind.live)
    return new_parameters()


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


def test_options_that_describe_the_boards_settings_can_only_be_read() -> None:
    store = ParameterStore(tree(BETAFLIGHT, rate_max=300.0))
    assert store.get("board.rate_max") == 300.0
    assert store.description("board.rate_max").unit == "deg/s"
    with pytest.raises(ReadOnlyError, match=r"set it at the start with --set board\.rate_max="):
        store.set({"board.rate_max": 400.0})


def test_a_board_without_options_adds_no_parameters() -> None:
    tree(CRAZYFLIE)
    with pytest.raises(UnknownParameterError):
        ParameterStore(tree(MIKROKOPTER)).get("board.pose_rate")
