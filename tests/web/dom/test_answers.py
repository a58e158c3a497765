"""A command is pending until a late answer or the vehicle's status settles it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from quadrotor.errors import NoAnswerError

FIGURE_8 = ".behavior:has-text('Figure 8') button"
TAKE_OFF = "#behaviors button:text-is('Take off')"
FLIES = {"behavior": "follow_trajectory"}
OLD = "#behavior[title^='last received']:not([title*=' 0.']):not([title*=' 1.'])"
"""Selector of a status above the second for which a press takes it for the newest."""
LATER = """(milliseconds) => { const now = performance.now.bind(performance);
  performance.now = () => now() + milliseconds; }"""
"""Script that advances the page's clock by so much."""


@pytest.fixture
def kept(kept_page: Any, flying: Any, station: Any, look_at: Any) -> Any:
    """Return the page of tests that leave its clock alone, when it shows a vehicle in hover."""
    kept_page.click("[data-tab=fly]")
    look_at(kept_page).text("#behavior", "^hover$")
    return kept_page


@pytest.fixture
def seen(kept: Any, look_at: Any) -> Any:
    return look_at(kept)


def is_gone(page: Any) -> None:
    page.wait_for_selector("#answer", state="hidden")


def test_a_late_answer_is_pending_and_then_what_it_says(kept: Any, seen: Any, station: Any) -> None:
    station.answering.clear()
    station.refusal = "the motors are hot"
    heard = "(button) => { button.click(); return document.getElementById('answer').className; }"
    assert kept.eval_on_selector(FIGURE_8, heard) == "pending", "it waits for no timer"
    seen.text("#answer .running", r"[\d.]+ s")
    station.answering.set()
    seen.text("#answer", "the motors are hot")
    seen.has_class("#answer", "bad")


@pytest.mark.parametrize("answers", [True, False])
def test_what_the_vehicle_shows_is_done_whatever_became_of_the_answer(
    kept: Any, seen: Any, station: Any, answers: bool
) -> None:
    station.silence = NoAnswerError("the vehicle has not answered")
    station.away = not answers
    if answers:
        station.answering.clear()
    kept.click(FIGURE_8)
    seen.has_class("#answer", "pending")
    station.said = FLIES
    seen.text("#answer", "^Figure 8: done")
    seen.has_class("#answer", "good")
    station.answering.set()
    is_gone(kept)


def test_what_nothing_shows_is_not_known_until_the_vehicle_does_something_else(
    page: Any, look: Any, station: Any
) -> None:
    station.silence = NoAnswerError("the vehicle has not answered")
    station.away = True
    page.click(FIGURE_8)
    look.has_class("#answer", "pending")
    page.evaluate(LATER, 11_000)
    look.text("#answer", "^Figure 8: not known whether.* shows armed, hover")
    look.has_class("#answer", "bad")
    station.said = {"behavior": "land"}
    is_gone(page)


def test_a_command_of_what_is_flown_already_is_not_taken_for_done(
    kept: Any, seen: Any, station: Any
) -> None:
    station.silence = NoAnswerError("the vehicle has not answered")
    station.away, station.said = True, FLIES
    seen.text("#behavior", "^follow trajectory$")
    kept.click(FIGURE_8)
    seen.text("#answer", "^Figure 8: not known whether.* shows armed, follow trajectory")


def test_what_a_vehicle_did_unheard_is_not_taken_for_done(
    page: Any, look: Any, station: Any, flying: Callable[[bool], None]
) -> None:
    """Without a status at the press, it may have flown this before."""
    station.silence = NoAnswerError("the vehicle has not answered")
    station.away = True
    page.click("[data-tab=fly]")
    look.text("#behavior", "^hover$")
    flying(False)
    page.wait_for_selector(OLD)  # not by a moved clock: the next summary would say a younger age
    page.click(FIGURE_8)
    station.said = FLIES
    flying(True)
    look.text("#behavior", "^follow trajectory$")
    look.text("#answer", "^Figure 8: not known whether.* shows armed, follow trajectory")


def test_a_refusal_goes_with_the_state_that_it_was_about(
    kept: Any, seen: Any, station: Any
) -> None:
    station.refusal = "the motors are off; arm the vehicle first"
    kept.click(TAKE_OFF)
    seen.text("#answer", "arm the vehicle first")
    kept.click("[data-tab=gains]")  # visible on all tabs, without a change of tab
    kept.wait_for_selector("#gains", state="visible")
    assert kept.is_visible("#answer")
    station.said = {"behavior": "take_off"}
    is_gone(kept)


def test_an_absent_station_is_said_until_it_is_heard_again(
    kept: Any, seen: Any, station: Any
) -> None:
    station.away = True
    kept.click(TAKE_OFF)
    seen.text("#answer", f"^Take off: {station.silence}")
    station.away = False
    is_gone(kept)
