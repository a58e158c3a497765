"""Search by Ctrl-K: what it finds, and that it shows a button without pressing it."""

from __future__ import annotations

from typing import Any

import pytest

TASKS = {
    "first flight": "First flight in ten minutes",
    "real vehicle": "Connect a real vehicle",
    "calibrate accelerometer": "Calibration",
    "change a gain": "Your gain session",
    "arm and take off": "First flight in ten minutes: Arm, take off and land",
    "undo a gain": "Changing parameters: History and undo",
    "figure 8": "Trajectories: Figure 8, circle, way-points and others",
    "find a run": "Runs: The page",
    "replay a run": "Replay: Runs",
    "export csv": "Runs: Export and the command line",
    "add beacon": "Beacons and the emulated bearing sensor: Adding and moving beacons",
    "obstacle": "3D view: Keep-out boxes",
    "what does a warning mean": "Troubleshooting: what a message or warning means",
    "step test": "Tuning bench: One test",
    "fly on bearings": "Flying on bearings",
    "own control law": "Control laws, estimators, behaviors and sensors of your own",
    "own experiment": "Your own experiment",
    "compare runs": "Runs: The page",
    "gamepad": "Sticks and emergencies: Gamepads",
    "vicon": "Tracking systems",
    "invite viewer": "Who may do what, and from where: Roles",
}
"""The commonest tasks in a person's words, and the section that says how."""
FIRST = """(() => {
  const all = [...document.querySelectorAll("#search-found li")];
  const at = all.findIndex((one) => one.textContent === "Documents");
  return all.slice(at + 1, at + 4).map((one) => one.firstElementChild.textContent);
})()"""
"""Script for the first three documents that are found."""
INPUT, FOUND = "#search-dialog input", "#search-found [role=option]"


@pytest.fixture
def page(open_page: Any, site: Any, flying: Any) -> Any:
    page = open_page(site)
    page.wait_for_selector("#documents button")
    page.click("#documents button")
    return page


def test_the_first_found_of_each_kind_is_what_was_meant(page: Any, look_at: Any) -> None:
    look = look_at(page)
    page.fill(INPUT, "take off")
    look.text(f"{FOUND} >> nth=0", "^Take off")
    page.fill(INPUT, "kp")
    look.text(f"{FOUND} >> nth=0", r"^gains\.kp")
    page.fill(INPUT, "tracking error distance")
    look.text(f"{FOUND} >> nth=0", r"^error\.distance")
    page.fill(INPUT, "by itself reactions")
    look.text(f"{FOUND} >> nth=0", "^What the vehicle does by itself: Reactions")
    page.fill(INPUT, "xyzzy")
    look.text("#search-dialog .state", "^Nothing is called “xyzzy”.$")


def test_a_parameter_is_shown_on_its_tab(page: Any) -> None:
    page.fill(INPUT, "gains.kp")
    page.wait_for_selector(FOUND)
    page.keyboard.press("Enter")
    page.wait_for_selector("#tab-gains", state="visible")
    assert page.input_value("#search") == "gains.kp"


def test_a_button_is_shown_and_not_pressed(page: Any, site: Any) -> None:
    sent = len(site.station.requests)
    page.fill(INPUT, "take off")
    page.wait_for_selector(FOUND)
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.textContent") == "Take off"
    assert len(site.station.requests) == sent


def test_the_guide_is_that_of_the_open_tab(page: Any) -> None:
    page.keyboard.press("Escape")
    page.click("[data-tab=calibrate]")
    page.wait_for_selector('#documents a[href$="/documents/of/calibrate"]')


def test_the_search_is_not_modal_and_closes_where_one_presses_beside_it(page: Any) -> None:
    page.wait_for_selector("#search-dialog[open]", state="attached")
    page.evaluate(
        "document.querySelector('#emergency').dispatchEvent("
        "new window.Event('pointerdown', { bubbles: true }))"
    )
    page.wait_for_selector("#search-dialog:not([open])", state="attached")
    page.click("#documents button")
    page.wait_for_selector("#search-dialog[open]", state="attached")
    page.keyboard.press("Escape")
    page.wait_for_selector("#search-dialog:not([open])", state="attached")


def test_the_document_of_each_common_task_is_among_the_first_three(page: Any) -> None:
    """Two steps from any page: Ctrl-K with a few words, then the document."""
    page.fill(INPUT, "first flight")
    page.wait_for_selector("#search-found .kind:has-text('Documents')")
    for words, wanted in TASKS.items():
        page.fill(INPUT, words)
        assert wanted in page.evaluate(FIRST), words


def test_other_pages_search_too_and_lead_to_the_console(
    open_page: Any, site: Any, flying: Any, look_at: Any
) -> None:
    page = open_page(site)
    page.goto(f"{site.base}/runs")
    page.wait_for_selector("#find button")
    page.click("#find button")
    page.fill(INPUT, "gains.kp")
    look_at(page).text(f"{FOUND} >> nth=0", r"^gains\.kp")
