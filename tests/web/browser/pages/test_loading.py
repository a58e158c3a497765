"""A page loads with few requests, and the emergency page works without scripts."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.waiting import wait_for
from vehicle_link.messages import header, new
from web.features import panels_of_extensions
from web.joined_files import join_modules
from web.static_files import STATIC

PROFILE = "first visit"
MOST = 18
"""Most requests of the main page until it is ready, with websockets and the 3D view's frame, and
without the script of each extension."""
HEAVIEST = 600_000
"""Most bytes of the main page's files and answers as sent, without the 3D view's client."""

RETURNS = re.DOTALL | re.MULTILINE
ALONE = {"console/app.js", "emergency/kill.js"}
"""Modules that start a page when they are loaded."""


def actions(station: Any) -> list[str]:
    return [request.action for name, request in station.requests if name == "emergency"]


@pytest.fixture
def counted(context: Any) -> Callable[[str], tuple[Any, list[str]]]:
    """Return `counted(address)`: a page, and the addresses that it requests from the network."""

    def open_at(address: str) -> tuple[Any, list[str]]:
        page, asked = context.new_page(), list[str]()
        page.on("request", lambda one: asked.append(one.url))
        page.on("websocket", lambda one: asked.append(one.url))
        page.goto(address)
        return page, asked

    return open_at


@pytest.mark.usefixtures("flying")
def test_the_main_page_is_ready_after_few_requests(
    site: Any, context: Any, admin: Any, counted: Any, look_at: Any
) -> None:
    context.add_cookies(site.cookies_of(admin))
    # The page reads the parameters again when the vehicle's have been read meanwhile.
    wait_for(lambda: admin.get("/api/parameters").json()["parameters"])
    answered: list[Any] = []
    context.on("requestfinished", lambda one: answered.append(one))
    page, asked = counted(site.base)
    page.wait_for_selector("#land:enabled")
    look_at(page).text("#chart-0 .legend output >> nth=0", r"\d")
    look_at(page).text("#link", "ms")
    page.wait_for_selector("#gains details", state="attached")
    page.wait_for_load_state("networkidle")
    files = [one for one in asked if "/static/" in one]
    assert sum(one.endswith("console/app.js") for one in files) == 1
    assert sum(one.endswith(".css") for one in files) == 1
    weights = {one.url: one.sizes()["responseBodySize"] for one in answered}
    assert next(weights[one] for one in files if one.endswith("app.js")) > 50_000  # not cached
    assert sum(weights.values()) <= HEAVIEST, weights
    # The 3D view is blank here; it would be one more websocket.
    extensions = [one for one in files if "/joined/extensions/" in one]
    assert len(extensions) == len({one.split("/joined/")[1] for one in extensions}) == 5
    assert len(asked) - len(extensions) + 1 <= MOST, "\n".join(asked)


@pytest.mark.parametrize(
    ("path", "name", "places"),
    [
        ("/kill", "emergency/kill", ()),
        ("/runs", "runs/runs", ("runs", "head")),
        ("/setup", "setup/setup", ("settings", "head")),
        ("/fleet", "fleet/fleet", ("fleet",)),
    ],
)
def test_the_other_pages_need_one_stylesheet_and_a_script_of_each_extension_and_their_own(
    site: Any, context: Any, admin: Any, counted: Any, path: str, name: str, places: tuple[str, ...]
) -> None:
    context.add_cookies(site.cookies_of(admin))
    page, asked = counted(f"{site.base}{path}")
    page.wait_for_load_state("networkidle")
    files = [one.rpartition("/joined/")[2] for one in asked if "/static/" in one]
    panels = [one for one in panels_of_extensions() if one.offer.place in places]
    scripts = [one.script.module for one in panels]
    assert sorted(files) == sorted([*scripts, f"{name}.css", f"{name}.js"])
    for one in panels:
        boxes = [part.bounding_box() for part in page.locator(f"#{one.offer.name} *").all()]
        assert any(box and box["height"] > 0.0 for box in boxes), one.offer.name


@pytest.fixture
def without_scripts(chromium: Any, site: Any, admin: Any) -> Iterator[Any]:
    context = chromium.new_context(java_script_enabled=False)
    context.add_cookies(site.cookies_of(admin))
    yield context.new_page()
    context.close()


def test_emergencies_work_without_scripts(
    site: Any, station: Any, without_scripts: Any, look_at: Any, until: Any
) -> None:
    page, look = without_scripts, look_at(without_scripts)
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode="armed"))
    page.goto(site.base)
    page.click("text=Emergency land")
    until(lambda: actions(station) == ["land"])
    look.text("h1", "Emergency land by admin.*accepted, not yet shown by the vehicle")
    mode = "emergency_land"
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode=mode))
    look.text("h1", "Landing, pressed by admin.*, acknowledged after")  # it reloads by itself
    page.click("text=Back to the page")
    page.click("text=Cut motors")
    look.text("h1", r"^Cut the motors of quad1\? It falls\.$")
    assert actions(station) == ["land"]
    page.click("text=Cut motors")
    until(lambda: actions(station) == ["land", "cut"])
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode="cut"))
    look.text("h1", "Motors cut, pressed by admin.*, acknowledged after")


def test_emergencies_work_before_the_scripts_have_come(
    site: Any, station: Any, context: Any, admin: Any, look_at: Any, until: Any
) -> None:
    context.add_cookies(site.cookies_of(admin))
    page = context.new_page()
    page.route("**/*.js", lambda route: None)  # never answered
    page.goto(site.base, wait_until="commit")
    page.click("#plain-emergency >> text=Emergency land")
    until(lambda: actions(station) == ["land"])
    look_at(page).text("h1", "Emergency land by admin")


def test_the_joined_script_gives_what_the_modules_export(
    site: Any, context: Any, admin: Any
) -> None:
    context.add_cookies(site.cookies_of(admin))
    page = context.new_page()
    page.goto(f"{site.base}/kill")
    made = join_modules("console/app.js", lambda name: (STATIC / name).read_text(), "", "/static/")
    given = dict(re.findall(r"^// ---- (\S+\.js)$.*?^return \{ (.*?) \};$", made.text, RETURNS))
    assert len(given) > 70
    wrong = page.evaluate(
        """async (given) => {
        const wrong = [];
        for (const [name, names] of Object.entries(given)) {
          const module = await import(`/static/${name}`);
          for (const one of names.split(", ").filter(Boolean))
            if (!(one in module)) wrong.push(`${name}: ${one}`);
        }
        return wrong; }""",
        {name: names for name, names in given.items() if name not in ALONE},
    )
    assert wrong == []


def test_forward_returns_to_the_page_that_back_has_left(page: Any, site: Any) -> None:
    def shows_the_scene() -> bool:
        inside = "() => document.getElementById('scene').contentWindow.location.pathname"
        return str(page.evaluate(inside)).endswith("/viser/")

    wait_for(shows_the_scene)
    page.goto(f"{site.base}/runs")
    page.wait_for_selector("#list")
    page.go_back()
    page.wait_for_selector("#behaviors button")
    wait_for(shows_the_scene)
    page.go_forward()
    page.wait_for_selector("#list")
    assert urlsplit(page.url).path == "/runs"
