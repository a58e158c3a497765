"""The section *Camera* of the Settings page, in Chromium."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from console.catalogue.catalogue import Catalogue
from extensions.vision.calibration.routes import calibrations_of
from extensions.vision.tags.detector import picture_with_corners
from extensions.vision.tags.intrinsics import load_intrinsics
from extensions.vision.tests.board_hand import Hand, walk
from tests.web.conftest import Site, serving

SIZES = ((1440, 900), (1024, 700), (2560, 1440))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    data = tmp_path_factory.mktemp("camera")
    catalogue = Catalogue(data)
    with serving(data, catalogue) as site:
        calibrations_of(data).pace = 0.0
        yield site
    catalogue.close()


@pytest.fixture
def page(context: Any, site: Site) -> Iterator[Any]:
    """Yield the Settings page; an error in its scripts fails the test."""
    problems: list[str] = []
    with site.sign_in() as client:
        context.add_cookies(site.cookies_of(client))
    made = context.new_page()
    made.on("pageerror", lambda error: problems.append(str(error)))
    made.goto(f"{site.base}/setup#camera")
    yield made
    assert problems == []


def test_a_camera_is_calibrated_with_a_board_that_is_moved_as_the_guide_says(
    site: Site, page: Any, look_at: Any
) -> None:
    look = look_at(page)
    look.text("#camera .facts", "none yet")
    assert "columns=7&rows=5&square=0.035" in page.get_attribute("#camera a.button", "href")
    page.select_option("#camera select", "simulated")
    page.get_by_label("Squares across").fill("2")
    page.click("#camera button:text-is('Calibrate')")
    look.text("#camera > .reason", "2 x 5 squares is not possible: allowed are 3 to 30")
    page.get_by_label("Squares across").fill("7")
    page.evaluate(
        """() => { window.said = []; const place = document.querySelector("#camera .instruction");
        new MutationObserver(() => said.push(place.textContent)).observe(place,
        { childList: true }); }"""
    )
    page.click("#camera button:text-is('Calibrate')")
    page.wait_for_selector("#camera .guided >> nth=0")
    with site.sign_in() as other:
        refused = other.post("/api/camera", json={"camera": 0})
        assert (refused.status_code, "is calibrating" in refused.json()["error"]) == (409, True)
    page.wait_for_selector("#camera .residual-picture circle >> nth=150", timeout=120_000)
    assert any(
        one.startswith(("Tilt the board", "Hold the board")) for one in page.evaluate("said")
    )
    assert page.locator("#camera .picture > svg g rect").count() > 20
    look.text(
        "#camera .counts >> nth=1", "Residual0[.]1. pixels rms.*Focal lengths(598|599|60[0-2])"
    )
    page.click("#camera button:text-is('Accept')")
    look.text("#camera > .note", "Accepted and stored in .*simulated.yaml")
    look.text("#camera .facts", "focal lengths .*, residual 0[.]1")
    lens = load_intrinsics(calibrations_of(site.data).store.path("simulated"))
    np.testing.assert_allclose(lens.matrix[[0, 1], [0, 1]], (600.0, 602.0), rtol=0.005)


@pytest.mark.parametrize("state", ["guide", "result"])
def test_the_section_is_accessible_and_nothing_is_crooked(
    site: Site, page: Any, look_at: Any, axe_in_both_themes: Any, crooked: Any, state: str
) -> None:
    cameras = calibrations_of(site.data)
    if state == "guide":  # with seven views taken
        guide = walk(7)
        hand = Hand(guide, np.random.default_rng(1))
        hand.hold("left", shown=1)
        guide.hint = "Hold the board still"
        jpeg = picture_with_corners(hand.picture(), guide.corners, taken=False)
        cameras._state, cameras._requester, cameras._camera = "running", "anna", 0
        cameras._take({**guide.state(), "picture": base64.b64encode(jpeg).decode()})
        page.wait_for_selector("#camera .counts dd >> nth=4")
        page.wait_for_selector("#camera .picture rect >> nth=5", state="attached")
    else:  # with a warning
        cameras._decision = ""
        cameras._state, cameras._found = "ready", replace(walk().result(), coverage=0.3)
        cameras._wake()
        page.wait_for_selector("#camera .warnings li")
    found = axe_in_both_themes(page, "#camera")
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
        found += [f"at {width} x {height}: {line}" for line in crooked(page)]
    assert found == []
