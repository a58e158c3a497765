"""Gamepads and keys that have gone silent, or that took another's place, move nothing.

The Gamepad API is replaced by objects that the tests move, and the page's time by the number of its
looks at them, so that a busy machine drops nothing. The page, its server and the frames between
them are real.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from web.commands import sticks

PADS = """() => {
  window.newPad = (index, id = 'twin') => ({ id, index, connected: true, mapping: 'standard',
    axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })),
    sends: true, last: 0,
    get timestamp() { if (this.sends) this.last = performance.now(); return this.last; } });
  window.pads = [window.newPad(0)];
  let now = performance.now(); // ms
  performance.now = () => now;
  navigator.getGamepads = () => { now += 20; window.looked?.(); return window.pads; };
  document.hasFocus = () => true;
  window.isSecureContext = true;
}"""
SHOULDER, FORWARD = 4, 3
SILENT = "the pad sent nothing for 0.5 s"


class Cockpit:
    """A page, its gamepads, and what its server passes on to the station."""

    def __init__(self, page: Any, station: Any, until: Callable[..., None]) -> None:
        self.page, self._station, self._until = page, station, until
        page.evaluate(PADS)
        self.seen()

    def seen(self, seconds: float = 0.04) -> None:
        """Let some time of the page pass, in which it reads the gamepads and acts on them."""
        self.page.evaluate(
            """(looks) => new Promise((done) => {
            window.looked = () => { if (looks-- <= 0) done(); }; })""",
            round(50.0 * seconds),
        )

    def move(self, pad: int, axis: int, value: float) -> None:
        self.page.evaluate("([p, i, v]) => { pads[p].axes[i] = v; }", [pad, axis, value])
        self.seen()

    def button(self, pad: int, pressed: bool, index: int = SHOULDER) -> None:
        self.page.evaluate(
            "([p, i, on]) => { pads[p].buttons[i] = { pressed: on, value: Number(on) }; }",
            [pad, index, pressed],
        )
        self.seen()

    def run(self, script: str) -> None:
        self.page.evaluate(f"() => {{ {script} }}")

    @property
    def flown(self) -> tuple[float, ...] | None:
        """Return the axes that the station got last; None while the sticks are released."""
        axes, enabled = self._station.sticks[-1] if self._station.sticks else ((), False)
        return axes if enabled else None

    def press(self, pad: int = 0) -> None:
        """Centre a pad, and press its button until it counts."""
        self.move(pad, FORWARD, 0.0)

        def on() -> bool:
            self.button(pad, False)
            self.button(pad, True)
            return self.flown is not None

        self._until(on)

    def fly(self, pad: int = 0, value: float = -0.6) -> None:
        self.press(pad)
        self.move(pad, FORWARD, value)
        self._until(lambda: self.flown is not None and self.flown[0] > 0.3)

    def stays_still(self) -> None:
        """Check that nothing flies the vehicle in some looks from now."""
        count = len(self._station.sticks)
        self.seen(0.1)
        assert not any(enabled for _, enabled in self._station.sticks[count:])


@pytest.fixture
def cockpit(
    page: Any, station: Any, until: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> Cockpit:
    monkeypatch.setattr(sticks, "SILENCE", 60.0)  # s: the server's time is not the page's
    page.keyboard.press("Escape")  # the help of a first visit
    station.sticks.clear()
    return Cockpit(page, station, until)


def test_a_gamepad_that_freezes_deflected_is_dropped_and_another_one_flies_after_a_new_press(
    cockpit: Cockpit, look: Any, station: Any, until: Callable[..., None]
) -> None:
    cockpit.fly()
    cockpit.run("pads.push(newPad(1)); pads[0].sends = false")
    cockpit.seen(0.3)
    assert cockpit.flown is not None
    cockpit.seen(0.2)
    until(lambda: cockpit.flown is None)
    assert station.sticks[-1] == ((0.0, 0.0, 0.0, 0.0), False)
    look.text("#sticks .note", f"^Off: {SILENT}. Release the button and all sticks")
    look.text("#events", f"sticks of .* dropped: {SILENT}")
    cockpit.stays_still()
    cockpit.button(1, True)  # it is read from here on, and this press does not count
    cockpit.stays_still()
    cockpit.fly(1, -0.8)


def test_a_gamepad_that_wakes_up_deflected_must_be_let_go_before_it_counts(
    cockpit: Cockpit, look: Any, until: Callable[..., None]
) -> None:
    cockpit.fly()
    cockpit.run("pads[0].sends = false")
    until(lambda: cockpit.flown is None)
    cockpit.run("pads[0].sends = true")
    cockpit.stays_still()
    cockpit.move(0, FORWARD, 0.0)
    cockpit.stays_still()
    cockpit.button(0, False)
    look.text("#sticks .note", f"^Dropped: {SILENT}. Press the button again")
    cockpit.fly()


def test_the_keyboard_flies_next_to_a_frozen_gamepad_without_its_deflection(
    cockpit: Cockpit, until: Callable[..., None]
) -> None:
    cockpit.fly()
    cockpit.run("pads[0].sends = false")
    until(lambda: cockpit.flown is None)
    cockpit.page.keyboard.down("Shift")
    until(lambda: cockpit.flown == (0.0, 0.0, 0.0, 0.0))
    cockpit.page.keyboard.down("a")
    until(lambda: cockpit.flown == (0.0, 1.0, 0.0, 0.0))
    cockpit.page.keyboard.up("a")
    cockpit.page.keyboard.up("Shift")
    until(lambda: cockpit.flown is None)
    cockpit.stays_still()


def test_a_frozen_gamepads_button_does_not_hold_the_sticks_for_the_keyboard(
    cockpit: Cockpit, look: Any, until: Callable[..., None]
) -> None:
    cockpit.press()
    cockpit.run("pads[0].sends = false")
    cockpit.seen(0.8)
    assert cockpit.flown == (0.0, 0.0, 0.0, 0.0), "at rest it may be silent"
    cockpit.page.keyboard.down("w")
    until(lambda: cockpit.flown is None)
    look.text("#sticks .note", SILENT)
    cockpit.page.keyboard.up("w")


def test_a_resting_gamepad_counts_at_once_when_it_moves(
    cockpit: Cockpit, until: Callable[..., None]
) -> None:
    cockpit.press()
    cockpit.run("pads[0].sends = false")
    cockpit.seen(0.8)
    cockpit.move(0, FORWARD, -0.6)  # seen by its values, also where a browser stamps nothing
    until(lambda: cockpit.flown is not None and cockpit.flown[0] > 0.3)


def test_a_gamepad_held_still_flies_as_long_as_the_browser_says_that_it_sends(
    cockpit: Cockpit,
) -> None:
    cockpit.fly()
    cockpit.seen(0.8)
    assert cockpit.flown is not None


@pytest.mark.parametrize(
    "replaced",
    [
        """const [gone] = pads; pads = [null, Object.assign(newPad(1), { axes: gone.axes,
        buttons: gone.buttons })];""",
        """const [gone] = pads; pads = [Object.assign(newPad(0), { axes: gone.axes,
        buttons: gone.buttons })];
        dispatchEvent(Object.assign(new Event('gamepaddisconnected'), { gamepad: gone }));""",
    ],
    ids=["another index", "the same index"],
)
@pytest.mark.parametrize("on_by", ["pad", "keyboard"])
def test_a_twin_that_takes_a_gamepads_place_must_be_seen_at_rest_first(
    cockpit: Cockpit, look: Any, until: Callable[..., None], replaced: str, on_by: str
) -> None:
    cockpit.fly()
    cockpit.run(replaced)
    until(lambda: cockpit.flown is None)
    look.text("#sticks .note", "^Off: centre all sticks and release the button first")
    twin = int(cockpit.page.evaluate("() => pads.length")) - 1
    cockpit.stays_still()
    if on_by == "keyboard":
        cockpit.page.keyboard.down("Shift")
        until(lambda: cockpit.flown == (0.0, 0.0, 0.0, 0.0))
        cockpit.move(twin, FORWARD, -1.0)
        assert cockpit.flown == (0.0, 0.0, 0.0, 0.0)
        cockpit.page.keyboard.up("Shift")
        until(lambda: cockpit.flown is None)
    cockpit.fly(twin)


def test_the_buttons_of_a_gamepad_that_lies_there_take_the_sticks_only_while_nobody_flies(
    cockpit: Cockpit, until: Callable[..., None]
) -> None:
    cockpit.run("pads.push(newPad(1, 'another'))")
    cockpit.fly()
    cockpit.button(1, True)
    cockpit.button(1, False)
    assert cockpit.flown is not None
    assert cockpit.flown[0] > 0.3
    cockpit.button(0, False)
    until(lambda: cockpit.flown is None)
    cockpit.fly(1)


def test_emergency_buttons_of_a_frozen_gamepad_count_as_soon_as_it_sends(
    cockpit: Cockpit, station: Any, until: Callable[..., None]
) -> None:
    cockpit.fly()
    cockpit.run("pads[0].sends = false")
    until(lambda: cockpit.flown is None)
    station.requests.clear()
    cockpit.button(0, True, index=1)
    until(lambda: [request.action for _, request in station.requests] == ["land"])


def test_a_key_whose_release_the_system_keeps_to_itself_does_not_stay_down(
    cockpit: Cockpit, until: Callable[..., None]
) -> None:
    keyboard = cockpit.page.keyboard
    keyboard.down("Shift")
    until(lambda: cockpit.flown is not None)
    keyboard.down("w")
    until(lambda: cockpit.flown == (1.0, 0.0, 0.0, 0.0))
    keyboard.down("Meta")  # macOS reports no release of other keys while it is held
    until(lambda: cockpit.flown is None)
    keyboard.up("Meta")
    keyboard.up("Shift")
    keyboard.up("w")
