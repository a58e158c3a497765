"""Beacons tab in Chromium: it shows what station and vehicle confirmed."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

from console.trackers.camera_figures import Figures
from extensions.vision.tags.detector import marked_picture
from vehicle_link.messages import decode, new
from vehicle_link.topics.measurements import PICTURE, encode_picture

COMPARED = "station.comparison.estimators"
TWICE = "tag 3 is seen twice"
FOURTH = ".residual[data-id='4']"


@pytest.fixture
def site(beacon_site: Any) -> Iterator[Any]:
    yield beacon_site
    station = beacon_site.station
    station.compared, station.residuals = True, None
    station.refusal = ""
    defaults = {one.name: one.default for one in station.store.descriptions()}
    changed = {n: v for n, v in defaults.items() if station.store.values()[n] != v}
    if changed:  # by the page's interface, so that the next page does not begin with the old ones
        with beacon_site.sign_in() as admin:
            answer = admin.put("/api/parameters", json={"values": changed})
            assert answer.status_code == 200, answer.text


@pytest.fixture
def tab(page: Any) -> Any:
    return opened(page)


def opened(page: Any) -> Any:
    page.click("[data-tab=beacons]")
    page.wait_for_selector(FOURTH)
    page.wait_for_selector("#beacons-errors .estimate")
    return page


def width_of(page: Any, selector: str) -> float:
    box = page.locator(selector).bounding_box()
    return float(box["width"]) if box else 0.0


# ---------------------------------------------------------------------- what is measured
def test_residual_bars_move_and_are_amber_beyond_three_deviations(
    tab: Any, look: Any, station: Any, until: Callable[..., None]
) -> None:
    station.residuals = {1: 0.01, 2: 0.02, 3: 0.03, 4: 0.1571}  # rad; 3 sigma are 0.0785
    look.text(f"{FOURTH} output", r"^9\.00°$")
    look.has_class(FOURTH, "beyond")
    before = width_of(tab, f"{FOURTH} .track i")
    station.residuals = {1: 0.01, 2: 0.02, 3: 0.03, 4: 0.03927}
    look.text(f"{FOURTH} output", r"^2\.25°$")
    look.has_no_class(FOURTH, "beyond")
    full = width_of(tab, f"{FOURTH} .track")
    # A whole bar is 5 sigma: 1.5 sigma are 0.3 of it.
    until(lambda: abs(width_of(tab, f"{FOURTH} .track i") - 0.3 * full) < 1.5)
    assert width_of(tab, f"{FOURTH} .track i") < before
    look.text("#beacons-residuals .limit", r"^3σ = 4\.50°$")


def test_the_chart_draws_errors_and_bound_on_either_scale(
    tab: Any, look: Any, until: Callable[..., None]
) -> None:
    look.text("#beacons-chart .legend .dashed output", r"^27\.0$")
    drawn = """() => { const c = document.querySelector('#beacons-chart canvas');
      return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); }"""
    until(lambda: tab.evaluate(drawn))
    tab.click("#beacons-chart button")
    assert tab.get_attribute("#beacons-chart button", "aria-pressed") == "true"
    until(lambda: tab.evaluate(drawn))
    tab.click("#beacons-chart button")


def test_a_file_is_refused_with_line_and_column(
    tab: Any, look: Any, station: Any, tmp_path: Path
) -> None:
    file = tmp_path / "lab.csv"
    file.write_text("id,x,y,z\n1,1,1,0\n2,-1,one,0\n")
    tab.set_input_files("#beacons-layout input[type=file]", str(file))
    look.text("#beacons-layout .reason", "beacons lab.csv, line 3, column 6: y is 'one'")
    file.write_text("id,x,y,z\n1,1,1,0\n2,-1,1,0\n3,-1,-1,0\n9,1,-1,0\n")
    tab.set_input_files("#beacons-layout input[type=file]", str(file))
    tab.wait_for_selector(".residual[data-id='9']")
    with tab.expect_download() as download:
        tab.click("#beacons-layout a")
    assert Path(download.value.path()).read_text().splitlines()[4] == "9,1.0,-1.0,0.0"


# ---------------------------------------------------------------------- roles and cost
def test_viewers_look_and_touch_nothing(
    tab: Any, site: Any, station: Any, context: Any, look_at: Any
) -> None:
    station.store.set({COMPARED: "error_state"})
    url = tab.request.post(f"{site.base}/api/invitations", data={"role": "viewer"}).json()["url"]
    token = parse_qs(urlsplit(url).query)["token"][0]
    guests = context.browser.new_context()
    guest = guests.new_page()
    guest.goto(f"{site.base}/?token={token}")
    guest.wait_for_selector("#behaviors button")
    opened(guest)
    inside = "#tab-beacons :is(button, input):enabled"
    found = guest.locator(inside).evaluate_all("all => all.map((one) => one.innerText)")
    assert found == ["vehicle", "error-state", "log"], "what only this page shows"
    enabled = guest.locator("#tab-beacons select:enabled").evaluate_all("all => all.length")
    assert enabled == 1, "the chart's time span only"
    guest.click(".estimate[data-name='error_state']")
    look_at(guest).text("#beacons-residuals h2", "of error-state")
    assert guest.locator("#beacons-view .reason").is_hidden()
    guests.close()


def test_a_hidden_tab_has_no_socket_and_no_signals(
    context: Any, open_page: Any, site: Any, flying: Any, until: Callable[..., None]
) -> None:
    sockets: list[Any] = []
    wanted: list[list[str]] = [[]]

    def watch(socket: Any) -> None:
        sockets.append(socket)
        if "/ws/telemetry" in socket.url:
            socket.on("framesent", lambda text: wanted.append(charted(text) or wanted[-1]))

    def charted(text: str) -> list[str]:
        series = json.loads(text).get("series", [])
        return [name for one in series for name in one["signals"]]

    def watch_all(new: Any) -> None:
        new.on("websocket", watch)

    context.on("page", watch_all)
    page = opened(open_page(site))
    context.remove_listener("page", watch_all)

    def feeds() -> list[Any]:
        return [one for one in sockets if one.url.endswith("/comparison")]

    def compared() -> list[str]:
        page.wait_for_timeout(20)  # processes its events
        return [name for name in wanted[-1] if name.startswith("comparison.")]

    until(lambda: bool(compared()))
    assert [one.is_closed() for one in feeds()] == [False]
    page.click("[data-tab=fly]")
    until(lambda: not compared() and feeds()[0].is_closed())
    page.click("[data-tab=beacons]")
    until(lambda: bool(compared()))
    assert [one.is_closed() for one in feeds()] == [True, False]


# ---------------------------------------------------------------------- the camera on board
def test_the_cameras_picture_is_shown_while_the_tab_is_open_and_its_silence_is_told(
    page: Any, look: Any, station: Any, until: Callable[..., None]
) -> None:
    figures = new("quadlab_msgs/CameraFigures", **Figures("", 30.0, 1.0, 121.0, 0.2)._asdict())
    status = new(
        "quadlab_msgs/TrackerStatus", system="onboard_camera 0", problem=TWICE, cameras=[figures]
    )
    grey, corners = np.full((48, 64), 90, np.uint8), np.array([[9, 9], [29, 9], [29, 29], [9, 29]])
    jpeg = marked_picture(grey, {3: corners.astype(float)}, {3})
    picture = decode(encode_picture(1, jpeg, "quad1"), PICTURE)
    tab, canvas = opened(page), "#beacons-camera canvas"
    assert tab.is_hidden("#beacons-camera")
    station.put("camera_status", status)
    until(lambda: station.forwarded == {"camera_picture"})

    def painted() -> bool:
        if "camera_picture" in station.forwarded:
            station.deliver("camera_picture", picture)
        return bool(tab.locator(f"{canvas}[width='64']").count())

    def shows(selector: str, pattern: str) -> bool:
        station.put("camera_status", status)  # on and on, as its process does
        tab.wait_for_timeout(100)
        return bool(re.search(pattern, tab.text_content(f"#beacons-camera {selector}")))

    until(painted)
    colour = tab.evaluate(
        f"[...document.querySelector('{canvas}').getContext('2d').getImageData(19, 29, 1, 1).data]"
    )
    assert colour[1] > colour[0] + 50, "the tag's outline is green"
    until(lambda: shows("figcaption", r"^30 pictures/s, .* 0\.20 pixels from their places$"))
    until(lambda: shows(".reason", "^tag 3 is seen twice$"))
    # No more pictures arrive, and then no more statuses.
    until(lambda: shows(".quiet", r"^No picture for ([3-9]|\d\d) s$"))
    look.text("#beacons-camera figcaption", "No data from the camera's process")
    look.has_class("#beacons-camera", "stale")
    tab.click("[data-tab=fly]")
    until(lambda: station.forwarded == set())
