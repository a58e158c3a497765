"""The 3D view in Chromium with software WebGL."""

from __future__ import annotations

from typing import Any

import pytest

NEEDS_WEBGL = True


def test_the_3d_view_shows_the_scene_and_reconnects(chromium: Any, site: Any, flying: Any) -> None:
    context = chromium.new_context(viewport={"width": 640, "height": 400})
    context.set_default_timeout(60_000)
    page = context.new_page()
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#behaviors button")
    page.goto(f"{site.base}/?fixedDpr")
    frame = page.query_selector("#scene").content_frame()
    names = ["/vehicle", "/vehicle/rotor_3", "/truth", "/ground", "/flown/head", "/wanted/0"]
    names += ["/beacons/3/ball", "/beacons/0/id", "/rays", "/cones", "/estimate/covariance"]
    has = "(names) => names.every((n) => n in (window.__viserSceneTree?.getState() ?? {}))"
    frame.wait_for_function(has, arg=names)
    shown = "() => window.__viserSceneTree.getState()['/vehicle'].visibility"
    assert frame.evaluate(f"{shown} !== false")
    assert len(set(page.locator("#scene").screenshot())) > 100, "the picture is blank"
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
    context.close()
