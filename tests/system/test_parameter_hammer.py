"""Two people on the same slider in two browsers: both end on the vehicle's value.

`QUADLAB_HAMMER_CHANGES=2000` makes it longer; `-s` shows the figures.
"""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.support.chromium import FLAGS

pytestmark = pytest.mark.timeout(300)
CHANGES = int(os.environ.get("QUADLAB_HAMMER_CHANGES", "20"))
"""Changes by each of the two that the vehicle applies before they let go."""
BOUND = 60_000
GAIN = "control.position.kp_xy"
ROW = f".gain:has(input[aria-label='{GAIN}'])"
SLIDER, CELL = f"{ROW} input[type=range]", f"{ROW} input.value"

HAMMER = """([selector, offset]) => {
  const slider = document.querySelector(selector);
  const fire = (type) => slider.dispatchEvent(new Event(type));
  let strokes = 0;
  fire("pointerdown");
  const timer = setInterval(() => {
    slider.value = (offset + 0.4 * strokes++) % 20;
    fire("input");
  }, 16);
  window.letGo = () => {
    clearInterval(timer);
    fire("pointerup");
    fire("change");
    return strokes;
  };
}"""


@pytest.fixture
def open_page(chromium_path: str) -> Iterator[Callable[[str], Any]]:
    """Yield `open_page(link)`, which opens a page in another browser; its scripts may not fail."""
    from playwright.sync_api import sync_playwright

    problems: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path, args=FLAGS)

        def open_at(link: str) -> Any:
            context = browser.new_context(viewport={"width": 1024, "height": 700})
            context.set_default_timeout(BOUND)
            page = context.new_page()
            page.on("pageerror", lambda error: problems.append(str(error)))
            page.route("**/viser/**", lambda route: route.fulfill(status=200, body=""))
            page.goto(link)
            page.wait_for_selector("#behaviors button")
            page.click("[data-tab=gains]")
            page.wait_for_selector(SLIDER, state="visible")
            return page

        yield open_at
        browser.close()
    assert problems == []


def test_two_people_hammer_one_slider_and_both_end_on_the_vehicles_value(
    lab: Any, until: Callable[..., Any], open_page: Callable[[str], Any]
) -> None:
    lab.reach(mode="ready")
    anna = open_page(lab.link())
    answer = lab.browser.post("/api/invitations", json={"role": "operator"})
    ben = open_page(answer.json()["url"])
    before = lab.get("/api/parameters")["revision"]
    older = history(lab)

    # Nobody in control: the first stroke takes it. Half-way it is handed over.
    for page, offset in ((anna, 0.1), (ben, 0.2)):
        page.evaluate(HAMMER, [SLIDER, offset])
    names = {label(anna): anna, label(ben): ben}
    first = until("somebody with control", lambda: names.get(lab.summary()["control"]["holder"]))
    second = ben if first is anna else anna
    until("changes by the first", lambda: len(since(older, lab)) >= CHANGES)

    def handed_over() -> bool:
        control(second, "ask")
        control(first, "give")
        return bool(lab.summary()["control"]["holder"] == label(second))

    until("the hand-over", handed_over)

    def both_changed() -> bool:
        applied = Counter(row["who"] for row in since(older, lab))
        return len(applied) == 2 and min(applied.values()) >= CHANGES

    until("changes by both", both_changed)
    holder = lab.summary()["control"]["holder"]
    strokes = [page.evaluate("letGo()") for page in (anna, ben)]

    def settled() -> bool:
        idle = all(not page.locator(f"{ROW}.waiting, {ROW}.late").count() for page in (anna, ben))
        status = lab.status().get("parameter_revision")
        return bool(idle and status == lab.get("/api/parameters")["revision"])

    until("calm", settled, 20)
    last = lab.status()["parameter_revision"]
    until("the last row", lambda: history(lab)[-1]["revision"] == last, 10)
    rows = since(older, lab)
    applied = Counter(row["who"] for row in rows)
    print(f"\n{strokes} strokes; {len(rows)} changes applied, {dict(applied)}")

    # All pages show the vehicle's value.
    value = float(f"{rows[-1]['new']:.7g}")
    for page in (anna, ben):
        assert float(page.locator(CELL).input_value()) == value
        assert float(page.locator(SLIDER).input_value()) == pytest.approx(value, abs=0.05)
    assert mirrored(lab) == rows[-1]["new"]

    # The history has each change once, in order, each from the value before it. Strokes come round
    # to the same values: one that sets the value which is in force is a revision, but no change.
    revisions = [before, *(row["revision"] for row in rows)]
    assert all(a < b for a, b in itertools.pairwise(revisions))
    assert all(a["new"] == b["old"] for a, b in itertools.pairwise(rows))
    loser = ben if holder == label(anna) else anna
    assert "has control" in loser.locator(f"{ROW} .reason").inner_text()


def label(page: Any) -> str:
    return str(page.evaluate("fetch('/api/session').then((r) => r.json()).then((s) => s.label)"))


def control(page: Any, action: str) -> None:
    """Request an action of control, which is refused if there is nothing to ask for or give."""
    page.evaluate(
        "(action) => fetch('/api/control', { method: 'POST', body: JSON.stringify({ action }),"
        " headers: { 'Content-Type': 'application/json' } })",
        action,
    )


def mirrored(lab: Any) -> Any:
    return next(p["value"] for p in lab.get("/api/parameters")["parameters"] if p["name"] == GAIN)


def since(older: list[dict[str, Any]], lab: Any) -> list[dict[str, Any]]:
    return history(lab)[len(older) :]


def history(lab: Any) -> list[dict[str, Any]]:
    """Return the history, oldest first."""
    rows: list[dict[str, Any]] = []
    before = 0
    while True:
        page = lab.get(f"/api/parameters/history?name={GAIN}&limit=1000&before={before}")["changes"]
        rows += page
        if len(page) < 1000:
            return rows[::-1]
        before = page[-1]["id"]
