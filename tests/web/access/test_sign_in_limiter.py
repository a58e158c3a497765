"""Limits on attempts at a password, on a clock that the test controls."""

from __future__ import annotations

import random

import pytest

from tests.support.clock import Clock
from web.access.sign_in_limiter import FORGOTTEN, FREE, LONGEST_WAIT, REMEMBERED, SignInLimiter

HERE, THERE = "192.0.2.1", "192.0.2.2"


@pytest.fixture
def clock() -> Clock:
    return Clock(1000.0)


@pytest.fixture
def limiter(clock: Clock) -> SignInLimiter:
    return SignInLimiter(clock)


def fail(limiter: SignInLimiter, address: str, name: str, times: int = FREE) -> None:
    for _ in range(times):
        assert limiter.begin(address, name) == 0.0


def test_waits_double_from_two_seconds_to_five_minutes(
    limiter: SignInLimiter, clock: Clock
) -> None:
    fail(limiter, HERE, "anna")
    waits = []
    for _ in range(12):
        wait = limiter.begin(HERE, "anna")
        assert limiter.begin(HERE, "anna") == wait, "asking does not make it longer"
        waits.append(wait)
        clock.now += wait
        assert limiter.begin(HERE, "anna") == 0.0
    assert waits == [2, 4, 8, 16, 32, 64, 128, 256, 300, 300, 300, 300]


def test_a_moment_before_the_end_of_the_wait_it_still_holds(
    limiter: SignInLimiter, clock: Clock
) -> None:
    fail(limiter, HERE, "anna")
    clock.now += 1.999
    assert limiter.begin(HERE, "anna") == pytest.approx(0.001)
    assert limiter.wait(HERE, "anna") == 1
    clock.now += 0.001
    assert limiter.wait(HERE, "anna") == 0
    assert limiter.begin(HERE, "anna") == 0.0


def test_a_name_waits_wherever_it_is_tried_from(limiter: SignInLimiter) -> None:
    for k in range(FREE):
        assert limiter.begin(f"192.0.2.{k}", "anna") == 0.0
    assert limiter.begin("198.51.100.1", "anna") > 0.0
    assert limiter.begin("198.51.100.1", "bob") == 0.0


def test_an_address_waits_whatever_name_it_tries(limiter: SignInLimiter) -> None:
    for k in range(FREE):
        assert limiter.begin(HERE, f"name{k}") == 0.0
    assert limiter.begin(HERE, "anna") > 0.0
    assert limiter.begin(THERE, "anna") == 0.0


def test_success_forgives_address_and_name(limiter: SignInLimiter) -> None:
    fail(limiter, HERE, "anna", FREE - 1)
    assert limiter.begin(HERE, "anna") == 0.0
    limiter.succeeded(HERE, "anna")
    assert len(limiter) == 0
    fail(limiter, HERE, "anna")


def test_ones_own_success_does_not_forgive_guesses_at_another(limiter: SignInLimiter) -> None:
    for _ in range(FREE):
        assert limiter.begin(HERE, "anna") == 0.0
        limiter.succeeded(HERE, "mallory")
    assert limiter.begin(THERE, "anna") > 0.0


def test_many_at_once_gain_nothing(limiter: SignInLimiter) -> None:
    """They are counted at the beginning, when none has failed yet."""
    assert sum(limiter.begin(HERE, "anna") == 0.0 for _ in range(100)) == FREE


def test_an_hour_without_a_failure_is_a_new_beginning(limiter: SignInLimiter, clock: Clock) -> None:
    fail(limiter, HERE, "anna")
    clock.now += FORGOTTEN + 1.0
    fail(limiter, HERE, "anna")


def test_days_of_failures_overflow_nothing(limiter: SignInLimiter, clock: Clock) -> None:
    for _ in range(3000):
        assert limiter.begin(HERE, "anna") == 0.0
        clock.now += LONGEST_WAIT
    assert limiter.begin(HERE, "anna") == 0.0
    assert limiter.begin(HERE, "anna") == LONGEST_WAIT


def test_memory_is_bounded(limiter: SignInLimiter, clock: Clock) -> None:
    seed = 20
    print(f"seed {seed}")
    numbers = random.Random(seed)
    for _ in range(3 * REMEMBERED):
        limiter.begin(f"10.{numbers.getrandbits(24)}", "x" * numbers.randrange(5000))
        clock.now += 0.001
    assert len(limiter) <= REMEMBERED


def test_a_network_of_ipv6_is_one_address(limiter: SignInLimiter) -> None:
    for k in range(FREE):
        assert limiter.begin(f"2001:db8::{k}", f"name{k}") == 0.0
    assert limiter.begin("2001:db8::ffff", "anna") > 0.0
    assert limiter.begin("2001:db8:0:1::1", "anna") == 0.0
    fail(limiter, "::ffff:192.0.2.9", "carl")
    assert limiter.begin("192.0.2.9", "dora") > 0.0, "one address, however it is written"
