"""3D view in Chromium with software WebGL."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

NEEDS_WEBGL = True


@pytest.fixture(scope="module")
def drawn(chromium: Any, site: Any) -> Iterator[Any]:
    """Yield a page with the 3D view, shared because the first picture takes longest."""
    with site.sign_in() as admin:
        cookies = site.cookies_of(admin)
    context = chromium.new_context(viewport={"width": 640, "height": 400})
    context.set_default_timeout(60_000)
    context.add_cookies(cookies)
    page = context.new_page()
    page.goto(f"{site.base}/?fixedDpr")
    page.wait_for_selector("#behaviors button")
    page.keyboard.press("Escape")  # the help of a first visit
    yield page
    context.close()


def test_the_3d_view_shows_the_scene_and_reconnects(drawn: Any, site: Any, flying: Any) -> None:
    page, frame = drawn, drawn.query_selector("#scene").content_frame()
    names = ["/vehicle", "/vehicle/rotor_3", "/truth", "/ground", "/flown/head", "/wanted/0"]
    names += ["/beacons/3/ball", "/beacons/0/id", "/rays", "/cones", "/estimate/covariance"]
    has = "(names) => names.every((n) => n in (window.__viserSceneTree?.getState() ?? {}))"
    frame.wait_for_function(has, arg=names)
    shown = "() => window.__viserSceneTree.getState()['/vehicle'].visibility"
    assert frame.evaluate(f"{shown} !== false")
    assert len(set(page.locator("#scene").screenshot())) > 100, "the picture is blank"
    context = "document.querySelector('canvas[data-engine]').getContext('webgl2')"
    assert frame.evaluate(f"{context}.getContextAttributes().antialias") is False
    assert not frame.evaluate("window.__viserMutable.backgroundMaterial.visible")
    server = site.view_server.viser._websock_server
    before = set(server._live_connections)
    server.disconnect_all_clients()
    for _ in range(600):
        now = set(server._live_connections)
        if now and now.isdisjoint(before):
            break
        page.wait_for_timeout(50)
    else:
        pytest.fail("the view did not reconnect")


def test_emergency_keys_and_help_work_after_a_click_into_the_drawn_view(
    drawn: Any, station: Any, flying: Any, until: Any
) -> None:
    page, frame = drawn, drawn.query_selector("#scene").content_frame()
    has = "() => '/vehicle' in (window.__viserSceneTree?.getState() ?? {})"
    frame.wait_for_function(has)
    frame.evaluate("window.reached = []; addEventListener('keydown', (e) => reached.push(e.key))")

    def actions() -> list[str]:
        return [request.action for name, request in station.requests if name == "emergency"]

    box = page.locator("#scene").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert page.evaluate("document.activeElement.id") == "scene"
    page.keyboard.press("x")  # not held: no effect
    page.keyboard.press("e")
    until(lambda: actions() == ["land"])
    page.keyboard.down("x")
    until(lambda: (page.wait_for_timeout(20), actions() == ["land", "cut"])[1])
    page.keyboard.up("x")
    page.keyboard.press("w")  # handled by the view itself
    page.keyboard.press("?")
    page.wait_for_selector("#help-panel[open]")
    assert frame.evaluate("reached") == ["w"], "ours must not move the camera as well"
