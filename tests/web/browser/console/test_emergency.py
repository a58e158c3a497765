"""Emergency controls in Chromium: two gestures, and no success shown before the vehicle's."""

from __future__ import annotations

from typing import Any

import pytest

from vehicle_link.messages import header, new


def show(station: Any, mode: str) -> None:
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode=mode))


def actions(station: Any) -> list[str]:
    return [request.action for name, request in station.requests if name == "emergency"]


@pytest.fixture
def still(kept_page: Any, station: Any) -> Any:
    """Return a page whose vehicle publishes only what the test requests."""
    show(station, "armed")
    kept_page.keyboard.press("Escape")  # the help of a first visit
    return kept_page


@pytest.fixture
def fresh(open_page: Any, site: Any, station: Any) -> Any:
    """Return such a page for a test that leaves it or changes it."""
    show(station, "armed")
    page = open_page(site)
    page.keyboard.press("Escape")
    return page


def test_without_quadlab_web_the_page_says_so_tries_again_and_gives_up(
    still: Any, station: Any, look_at: Any
) -> None:
    look = look_at(still)
    still.route("**/api/commands/emergency", lambda route: route.abort())
    still.click("#emergency-land")
    look.text("#emergency-state", "server does not answer, retrying.*, pressed")
    look.text("#emergency-state", "failed: this page's server does not answer.*Press again")
    still.click("#emergency-land")
    look.text("#emergency-state", "retrying")
    still.unroute("**/api/commands/emergency")
    look.text("#emergency-state", "accepted, not yet shown")
    assert actions(station) == ["land"]


def test_keys_work_on_keyboards_that_write_no_latin_letters(
    still: Any, station: Any, until: Any
) -> None:
    still.evaluate(
        """document.dispatchEvent(new KeyboardEvent('keydown', { key: 'у', code: 'KeyE' }))"""
    )
    until(lambda: (still.wait_for_timeout(20), actions(station) == ["land"])[1])
    moving = still.evaluate(
        """async () => { const { StickKeys } = await import('/static/sticks/keyboard.js');
        const sticks = new StickKeys(), seen = [];
        for (const type of ['keydown', 'keyup']) {
          const key = { key: 'ц', code: 'KeyW', bubbles: true };
          document.dispatchEvent(new KeyboardEvent(type, key));
          seen.push(sticks.moving);
        }
        return seen; }"""
    )
    assert moving == [True, False]


TOGETHER = """async (wait) => { const { StickKeys } = await import('/static/sticks/keyboard.js');
  const sticks = new StickKeys();
  const press = (key, code) => document.dispatchEvent(
    new KeyboardEvent('keydown', { key, code, bubbles: true }));
  press('w', 'KeyW');
  if (wait) await new Promise((resolve) => setTimeout(resolve, wait));
  sticks.step(0.1);
  press('Shift', 'ShiftLeft');
  const counts = sticks.centred;
  sticks.restart();
  return [counts, sticks.step(0.1)[0]]; }"""


@pytest.mark.parametrize(("wait", "counts"), [(0, True), (400, False)])
def test_a_key_pressed_with_shift_steers_from_zero_and_one_held_for_long_does_not(
    still: Any, wait: int, counts: bool
) -> None:
    assert still.evaluate(TOGETHER, wait) == [counts, pytest.approx(0.2)]


def test_the_emergency_page_works_without_its_events(
    site: Any, fresh: Any, station: Any, look_at: Any
) -> None:
    fresh.route_web_socket("**/ws/events", lambda socket: socket.close())
    fresh.goto(f"{site.base}/kill")
    look = look_at(fresh)
    look.text("#state", "no connection to this page's server.*The buttons still send")
    assert fresh.locator("iframe, canvas").count() == 0
    fresh.click("#cut")
    look.text("#answer", "accepted, not yet shown")
    show(station, "cut")
    look.text("#answer", "motors cut, acknowledged after")
    assert actions(station) == ["cut"]
