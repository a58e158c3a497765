"""Every route and websocket against every kind of caller: the table of permissions.

The routes are read from the application: a new one without a line in `LEAST` fails.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
import websockets.exceptions

from web.access.roles import Role
from web.access.sessions import SESSION_AGE, Sessions

VIEWER, OPERATOR, ADMIN = Role
RUN = "20260131T093042Z_quad1"
LEAST: dict[str, tuple[Role, Any]] = {
    # The least role, and a valid body.
    "GET /api/openapi.json": (VIEWER, None),
    "GET /": (VIEWER, None),
    "GET /kill": (VIEWER, None),
    "GET /emergency": (VIEWER, None),
    "POST /emergency": (VIEWER, None),
    "GET /favicon.ico": (VIEWER, None),
    "GET /vendor/{name}": (VIEWER, None),
    "GET /static/console/app.js": (VIEWER, None),
    "GET /viser/": (VIEWER, None),
    "GET /api/session": (VIEWER, None),
    "GET /api/signals": (VIEWER, None),
    "GET /api/behaviors": (VIEWER, None),
    "GET /api/summary": (VIEWER, None),
    "GET /api/events": (VIEWER, None),
    "GET /api/parameters": (VIEWER, None),
    "PUT /api/parameters": (OPERATOR, {"values": {"gains.kp": 5.0}}),
    "GET /api/parameters/history": (VIEWER, None),
    "GET /api/parameters/flight": (VIEWER, None),
    "GET /api/parameters/file": (VIEWER, None),
    "POST /api/parameters/file": (OPERATOR, {}),
    "GET /api/parameters/presets": (VIEWER, None),
    "POST /api/parameters/presets": (OPERATOR, {"name": "x", "parameters": ["no.such"]}),
    "GET /api/parameters/presets/{preset}": (VIEWER, None),
    "DELETE /api/parameters/presets/{preset}": (OPERATOR, None),
    "POST /api/parameters/presets/{preset}/restore": (OPERATOR, {}),
    "POST /api/commands/arm": (OPERATOR, {}),
    "POST /api/commands/disarm": (OPERATOR, {}),
    "POST /api/commands/start_behavior": (OPERATOR, {"name": "land"}),
    "POST /api/trajectories/preview": (OPERATOR, {"arguments": {"trajectory": "none"}}),
    "POST /api/commands/emergency": (VIEWER, {"action": "land"}),
    "POST /api/commands/record": (OPERATOR, {"start": True}),
    "POST /api/invitations": (OPERATOR, {"role": "viewer"}),
    "POST /api/view/camera": (VIEWER, {"view": "x", "camera": "free"}),
    "PUT /api/view": (OPERATOR, {"truth": True}),
    "PUT /api/draft": (OPERATOR, {"kind": "none"}),
    "DELETE /api/draft": (OPERATOR, None),
    "GET /runs": (VIEWER, None),
    "GET /api/runs": (VIEWER, None),
    "GET /api/runs/search": (VIEWER, None),
    "GET /api/runs/{run_id}/download": (VIEWER, None),
    "HEAD /api/runs/{run_id}/download": (VIEWER, None),
    "PUT /api/runs/{run_id}/notes": (OPERATOR, {"notes": ""}),
    "GET /api/runs/{run_id}/notes": (VIEWER, None),
    "PUT /api/runs/{run_id}/title": (OPERATOR, {"title": ""}),
    "GET /api/runs/{run_id}/again": (VIEWER, None),
    "GET /api/runs/{run_id}/marks": (VIEWER, None),
    "POST /api/runs/{run_id}/link": (VIEWER, {}),
    "GET /signed/runs/{name}": (VIEWER, None),
    "HEAD /signed/runs/{name}": (VIEWER, None),
    "GET /api/tags": (VIEWER, None),
    "POST /api/tags": (OPERATOR, {"runs": ["unknown"]}),
    "POST /api/marks": (OPERATOR, {"id": "mark-0001", "ago": 0.1}),
    "GET /api/storage": (VIEWER, None),
    "GET /api/onboard": (VIEWER, None),
    "POST /api/onboard/{name}/download": (OPERATOR, {}),
    "POST /api/onboard/{name}/cancel": (OPERATOR, {}),
    "POST /api/runs/{run_id}/backfill": (OPERATOR, {}),
    "POST /api/runs/{run_id}/backfill/cancel": (OPERATOR, {}),
    "GET /api/trash": (VIEWER, None),
    "POST /api/trash": (OPERATOR, {"runs": ["unknown"]}),
    "POST /api/trash/restore": (OPERATOR, {"runs": ["unknown"]}),
    "POST /api/trash/empty": (ADMIN, {}),
    "GET /api/runs/{run_id}/report": (VIEWER, None),
    "POST /api/runs/{run_id}/report": (OPERATOR, {}),
    "GET /api/runs/{run_id}/report_making": (VIEWER, None),
    "GET /api/runs/{run_id}/report/{name}": (VIEWER, None),
    "GET /report/{run_id}": (VIEWER, None),
    "GET /replay/{run_id}": (VIEWER, None),
    "GET /api/replay": (VIEWER, None),
    "GET /api/replay/{run_id}": (VIEWER, None),
    "GET /api/replay/{run_id}/track": (VIEWER, None),
    "GET /api/replay/{run_id}/window": (VIEWER, None),
    "GET /api/replay/{run_id}/spectrogram": (VIEWER, None),
    "GET /api/replay/{run_id}/spectrum": (VIEWER, None),
    "GET /api/replay/{run_id}/picture": (VIEWER, None),
    "GET /api/replay/{run_id}/at": (VIEWER, None),
    "GET /api/replay/{run_id}/expressions": (VIEWER, None),
    "GET /api/replay/{run_id}/statistics": (VIEWER, None),
    "GET /api/expressions": (VIEWER, None),
    "GET /compare": (VIEWER, None),
    "GET /design": (ADMIN, None),
    "GET /api/experiments": (VIEWER, None),
    "GET /api/experiments/results": (VIEWER, None),
    "POST /api/experiments/start": (OPERATOR, {}),
    "POST /api/experiments/finish": (OPERATOR, {}),
    "POST /api/experiments/stop": (OPERATOR, {}),
    "POST /api/experiments/confirm": (OPERATOR, {"question": "Are propellers off?"}),
    "POST /api/experiments/accept": (OPERATOR, {}),
    "POST /api/experiments/reject": (OPERATOR, {}),
    "GET /api/calibrations": (VIEWER, None),
    "GET /api/campaigns": (VIEWER, None),
    "GET /api/campaigns/{name}": (VIEWER, None),
    "GET /api/campaigns/{name}/against/{other}": (VIEWER, None),
    "GET /api/campaigns/{name}/flights/{index}": (VIEWER, None),
    "GET /api/campaigns/{name}/report": (VIEWER, None),
    "POST /api/campaigns/{name}/flights/{index}": (OPERATOR, None),
    "GET /api/trends": (VIEWER, None),
    "GET /api/arena": (VIEWER, None),
    "GET /api/arena/{name}": (VIEWER, None),
    "GET /api/checklist": (VIEWER, None),
    "PUT /api/checklist": (OPERATOR, {"items": ["Nets closed"]}),
    "POST /api/checklist/tick": (OPERATOR, {"item": "Nets closed", "done": True}),
    "POST /api/figure": (VIEWER, {}),
    "GET /api/documents": (VIEWER, None),
    "GET /documents": (VIEWER, None),
    "GET /documents/of/{tab}": (VIEWER, None),
    "GET /documents/find": (VIEWER, None),
    "GET /documents/{path:path}": (VIEWER, None),
    "GET /api/beacons": (VIEWER, None),
    "GET /api/beacons/file": (VIEWER, None),
    "PUT /api/beacons": (OPERATOR, {"preset": "nothing"}),
    "PUT /api/beacons/view": (OPERATOR, {}),
    "GET /api/beacons/survey": (VIEWER, None),
    "POST /api/beacons/survey": (OPERATOR, {"run_id": "none"}),
    "POST /api/beacons/survey/accept": (OPERATOR, {}),
    "POST /api/beacons/survey/reject": (OPERATOR, {}),
    "POST /api/commands/simulation": (OPERATOR, {"action": "swap_battery"}),
    "POST /api/control": (OPERATOR, {"action": "ask"}),
    "GET /api/tuning": (VIEWER, None),
    "GET /api/spectrogram": (VIEWER, None),
    "GET /api/spectrum": (VIEWER, None),
    "POST /api/tuning/run": (OPERATOR, {}),
    "GET /api/tuning/runs/{run_id}": (VIEWER, None),
    "DELETE /api/tuning/runs/{run_id}": (OPERATOR, None),
    "POST /api/tuning/runs/{run_id}/restore": (OPERATOR, {}),
    "POST /api/tuning/runs/{run_id}/gains": (OPERATOR, {}),
    "POST /api/session/sign_out": (VIEWER, {}),
    "PUT /api/session/password": (VIEWER, {"current": "x", "password": "x"}),
    "GET /fleet": (VIEWER, None),
    "GET /api/fleet": (VIEWER, None),
    "POST /api/fleet/land": (VIEWER, {}),
    "GET /api/formation": (VIEWER, None),
    "PUT /api/formation": (OPERATOR, {"speed": 0.5}),
    "POST /api/foxglove/link": (VIEWER, {}),
    "GET /api/foxglove/layout": (VIEWER, None),
    "GET /setup": (VIEWER, None),
    "GET /api/setup/vehicles": (VIEWER, None),
    "GET /api/setup/people": (VIEWER, None),
    "GET /api/setup/checks": (VIEWER, None),
    "POST /api/setup/checks": (OPERATOR, None),
    "GET /api/camera/devices": (VIEWER, None),
    "GET /api/camera/board.pdf": (VIEWER, None),
    "GET /api/camera": (VIEWER, None),
    "POST /api/camera": (OPERATOR, {}),
    "POST /api/camera/finish": (OPERATOR, None),
    "POST /api/camera/cancel": (OPERATOR, None),
    "POST /api/camera/accept": (OPERATOR, None),
    "GET /api/users": (ADMIN, None),
    "POST /api/users": (ADMIN, {"name": "B", "password": "x"}),
    "DELETE /api/users/{name}": (ADMIN, None),
    "PUT /api/users/{name}/role": (ADMIN, {"role": "viewer"}),
    "PUT /api/users/{name}/password": (ADMIN, {"password": "x"}),
    "POST /api/users/{name}/end_sessions": (ADMIN, None),
    "WEBSOCKET /viser": (VIEWER, None),
    "WEBSOCKET /ws/telemetry": (VIEWER, None),
    "WEBSOCKET /ws/events": (VIEWER, None),
    "WEBSOCKET /ws/stick": (OPERATOR, None),
    "WEBSOCKET /comparison": (VIEWER, None),
    "WEBSOCKET /ws/picture/{camera}": (VIEWER, None),
    "WEBSOCKET /camera": (VIEWER, None),
    "WEBSOCKET /ws/fleet": (VIEWER, None),
    "WEBSOCKET /formation": (VIEWER, None),
    "WEBSOCKET /formation/sticks": (OPERATOR, None),
    "WEBSOCKET /foxglove": (VIEWER, None),
}
HTTP = [route for route in LEAST if not route.startswith("WEBSOCKET")]
SOCKETS = [route for route in LEAST if route.startswith("WEBSOCKET")]
SAFE = ("GET", "HEAD")
Cookie = Callable[[str], str | None]


def routes_of(app: Any) -> set[str]:
    """Return `METHOD /path` of all routes, without the HEAD of a route that has a GET."""
    found = set()
    for route in app.routes:
        methods = getattr(route, "methods", None)
        if type(route).__name__ == "Mount":
            assert route.path == "/static", "a mounted application is checked by its files"
            found.add("GET /static/console/app.js")
        elif methods is None:
            found.add(f"WEBSOCKET {route.path}")
        else:
            kept = methods - {"HEAD"} if "GET" in methods else methods
            found |= {f"{method} {route.path}" for method in kept}
    return found


def test_every_route_of_the_application_is_in_the_table(site: Any) -> None:
    (app,) = site.gate._app.apps.values()
    routes = routes_of(app)
    assert routes - LEAST.keys() == set(), "say in LEAST who may use the new routes"
    assert LEAST.keys() - routes == set(), "these are gone; take them out of LEAST"


@pytest.fixture(scope="module")
def cookie(site: Any) -> Cookie:
    """Return a function that gives a caller's Cookie header.

    The session is opened once, and again after it has ended.
    """
    tokens, sessions = site.gate._people.tokens, site.gate._people.sessions
    name = site.gate._people.cookie.name
    made: dict[str, str] = {}

    def value_of(caller: str) -> str:
        if caller == "expired":
            long_ago = time.time() - SESSION_AGE - 1.0
            old = Sessions(sessions._database, lambda: long_ago)
            return str(tokens.sign(old.open("admin 7", ADMIN)))
        role = Role(caller) if caller in set(Role) else ADMIN
        session = sessions.open(f"{role.value} 7", role)
        value = str(tokens.sign(session))
        if caller == "ended":
            sessions.end(session)
        if caller == "forged":
            payload, stamp, signature = value.rsplit(".", 2)
            value = ".".join((payload, stamp, signature[::-1]))
        return value

    def make(caller: str) -> str | None:
        if caller == "nobody":
            return None
        is_over = caller in set(Role) and tokens.session(made.get(caller)) is None
        if is_over or caller not in made or caller == "expired":  # the server drops those
            made[caller] = value_of(caller)
        return f"{name}={made[caller]}"

    return make


@pytest.fixture(scope="module")
def browser(site: Any) -> Iterator[httpx.Client]:
    """Yield a client that keeps its connection."""
    with site.browser() as client:
        yield client


def path_of(route: str) -> str:
    path = route.split(" ", 1)[1]
    name = "uPlot.iife.js" if "vendor" in path else "nobody"
    for place, word in {
        "{run_id}": RUN,
        "{name}": name,
        "{camera}": "tracker",
        "{other}": "nobody",
        "{index}": "0",
        "{tab}": "fly",
        "{path:path}": "nothing.html",
    }.items():
        path = path.replace(place, word)
    return path


def ask(browser: httpx.Client, route: str, cookie: str | None, **headers: str) -> httpx.Response:
    method, _ = route.split(" ", 1)
    if cookie is not None:
        headers["Cookie"] = cookie
    browser.cookies.clear()  # from an earlier answer
    return browser.request(method, path_of(route), json=LEAST[route][1], headers=headers)


@pytest.mark.parametrize("caller", ["nobody", "expired", "forged", "ended"])
def test_without_an_open_session_nothing_is_answered(
    browser: httpx.Client, station: Any, cookie: Cookie, caller: str
) -> None:
    answered = {route: ask(browser, route, cookie(caller)).status_code for route in HTTP}
    assert answered == dict.fromkeys(HTTP, 401)
    assert station.requests == []


@pytest.mark.parametrize("role", list(Role))
def test_each_role_may_what_the_table_says(
    browser: httpx.Client, station: Any, cookie: Cookie, role: Role
) -> None:
    wrong = {}
    for route in HTTP:
        station.requests.clear()
        answer = ask(browser, route, cookie(role.value))
        if role.may(LEAST[route][0]):
            is_right = answer.status_code not in (401, 403)
        else:
            is_right = (
                answer.status_code == 403
                and f"{role.value} 7" in answer.json()["error"]
                and station.requests == []
            )
        if not is_right:
            wrong[route] = f"{answer.status_code} {answer.text}"
    assert wrong == {}


def test_no_other_site_may_change_anything(
    browser: httpx.Client, station: Any, cookie: Cookie
) -> None:
    wrong = {}
    for route in HTTP:
        if route.split()[0] not in SAFE:
            answer = ask(browser, route, cookie("admin"), Origin="http://evil.example")
            if answer.status_code != 403 or "another site" not in answer.json()["error"]:
                wrong[route] = f"{answer.status_code} {answer.text}"
    assert wrong == {}
    assert station.requests == []


def test_no_other_site_may_read_an_answer(browser: httpx.Client, cookie: Cookie) -> None:
    """Without this header, the browser withholds the answer from the other site's scripts."""
    for route in HTTP:
        if route.split()[0] in SAFE:
            answer = ask(browser, route, cookie("admin"), Origin="http://evil.example")
            assert "access-control-allow-origin" not in answer.headers, route


def connect(site: Any, route: str, cookie: str | None, origin: str | None = None) -> int:
    """Return 101, or the status of the refusal."""
    spoken = {"/viser": f"viser-v{site.view_server.version}", "/foxglove": "foxglove.sdk.v1"}
    try:
        with site.websocket(path_of(route), cookie, origin, spoken.get(route.split()[1])):
            return 101
    except websockets.exceptions.InvalidStatus as refused:
        return int(refused.response.status_code)


@pytest.mark.parametrize("caller", ["nobody", "expired", "forged", "ended"])
def test_no_websocket_without_an_open_session(site: Any, cookie: Cookie, caller: str) -> None:
    answered = {route: connect(site, route, cookie(caller)) for route in SOCKETS}
    assert answered == dict.fromkeys(SOCKETS, 401)


@pytest.mark.parametrize("role", list(Role))
def test_each_role_has_the_websockets_of_the_table(site: Any, cookie: Cookie, role: Role) -> None:
    expected = {route: 101 if role.may(LEAST[route][0]) else 403 for route in SOCKETS}
    assert {route: connect(site, route, cookie(role.value)) for route in SOCKETS} == expected


def test_no_websocket_for_another_site(site: Any, cookie: Cookie) -> None:
    answered = {
        route: connect(site, route, cookie("admin"), "http://evil.example") for route in SOCKETS
    }
    assert answered == dict.fromkeys(SOCKETS, 403)
