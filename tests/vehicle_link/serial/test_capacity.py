"""Loop rates that the serial ports can carry."""

from __future__ import annotations

import pytest

from quadrotor.errors import UsageError
from vehicle_link.serial.capacity import (
    DATA_FRAME,
    check_rate,
    rate_below,
    sample_period_us,
    samples_a_second,
)
from vehicle_link.serial.commands import encode_command, encode_data


def test_the_ports_carry_what_their_frames_leave() -> None:
    assert len(encode_data(bytes(20))) == DATA_FRAME
    assert [samples_a_second(ports) for ports in (1, 2)] == [338, 677]
    assert len(encode_command((0, 0, 0, 0))) * 677 < 2 * 11_520


@pytest.mark.parametrize(("rate", "ports"), [(60, 1), (338, 1), (677, 2), (1000, None)])
def test_rates_that_are_carried_are_taken(rate: int, ports: int | None) -> None:
    check_rate(rate, ports)


@pytest.mark.parametrize("rate", [-1, 0, 59, 1001])
@pytest.mark.parametrize("ports", [1, 2, None])
def test_rates_out_of_bounds_are_refused_with_the_bounds(rate: int, ports: int | None) -> None:
    with pytest.raises(UsageError, match=f"--rate {rate} .*allowed are 60 to 1000 Hz"):
        check_rate(rate, ports)


@pytest.mark.parametrize(("rate", "ports"), [(339, 1), (500, 1), (678, 2), (1000, 2), (1000, 1)])
def test_rates_beyond_the_ports_are_refused_with_what_to_try(rate: int, ports: int) -> None:
    with pytest.raises(UsageError) as error:
        check_rate(rate, ports)
    said = str(error.value)
    assert f"--rate {rate}" in said
    assert f"{samples_a_second(ports)} samples a second" in said
    assert f"try --rate {rate_below(ports)}" in said
    assert ("both ports" in said) == (ports == 1 and rate <= 677)
    assert "--in-process" in said
    assert "\n" not in said
    check_rate(rate_below(ports), ports)


def test_the_period_is_the_nearest_microsecond() -> None:
    assert [sample_period_us(rate) for rate in (60, 500, 650, 1000)] == [16_667, 2000, 1538, 1000]
