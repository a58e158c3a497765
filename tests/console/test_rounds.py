"""Periodic tasks that share a thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

from console.rounds import run_rounds


def test_each_task_comes_in_its_turn_until_the_end_and_one_that_fails_stops_no_other() -> None:
    closing, called, failed = threading.Event(), list[str](), list[str]()

    def often() -> None:
        called.append("often")
        if called.count("often") == 6:
            closing.set()

    def seldom() -> None:
        called.append("seldom")
        raise ValueError("a defect")

    def guard(act: Callable[[], None]) -> None:
        try:
            act()
        except ValueError as error:
            failed.append(str(error))

    run_rounds({often: 0.01, seldom: 0.035}, closing, guard)
    assert called.count("often") == 6
    assert 1 <= called.count("seldom") <= 6
    assert failed == ["a defect"] * called.count("seldom")
    assert called[0] == "often"
