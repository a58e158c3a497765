"""Routes of the replay page: all roles may replay, and no path leads out of the folders."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.runs.adoption import tidy_runs
from extensions.replay.store import Building, ReplayStore

Until = Callable[..., None]
RUN, SECOND, TORN = "20260131T093042Z_quad1", "20260131T100000Z_quad1", "20260131T110000Z_quad1"
SHORT = MadeRun(7.0, marks=[(5.0, "gust")], pictures=[(3.0, b"\xff\xd8 one"), (4.0, b"\xff\xd8")])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_run(tmp_path_factory.mktemp("made") / "a.mcap", SHORT).read_bytes()


@pytest.fixture(scope="module")
def replay_site(
    tmp_path_factory: pytest.TempPathFactory, recorded: bytes
) -> Iterator[Callable[[type], Any]]:
    data = tmp_path_factory.mktemp("data")
    catalogue = Catalogue(data)
    for name, content in ((RUN, recorded), (SECOND, recorded), (TORN, b"")):
        (data / "runs" / f"{name}.mcap").write_bytes(content)
    (data / "onboard").mkdir()
    (data / "onboard" / "quad1_flight.mcap").write_bytes(recorded)
    for folder in ("onboard/quad2", "vehicles/quad3/onboard"):
        (data / folder).mkdir(parents=True)
    (data / "onboard" / "quad2" / "quad2_flight.mcap").write_bytes(recorded)
    (data / "vehicles" / "quad3" / "onboard" / "quad3_flight.mcap").write_bytes(recorded)
    tidy_runs(catalogue)
    opened: list[Any] = []

    def site(serve: type) -> Any:
        if not opened:
            serving = serve(data, catalogue)
            opened.extend((serving, serving.__enter__()))
        return opened[1]

    yield site
    if opened:
        opened[0].__exit__()


@pytest.fixture
def viewer_there(replay_site: Any, serve: type) -> Iterator[httpx.Client]:
    site = replay_site(serve)
    with site.sign_in() as admin, site.invited(admin, "viewer") as client:
        yield client


def described(client: httpx.Client, run: str, until: Until) -> dict[str, Any]:
    found: list[dict[str, Any]] = []

    def is_ready() -> bool:
        answer = client.get(f"/api/replay/{run}")
        assert answer.status_code == 200, answer.text
        found.append(answer.json())
        return bool(found[-1]["state"] == "ready")

    until(is_ready, 60.0)
    assert all(0.0 <= one["progress"] <= 1.0 for one in found[:-1])
    return found[-1]


@pytest.mark.parametrize("run", [RUN, "onboard:quad1_flight", "onboard:quad3:here:quad3_flight"])
def test_a_viewer_replays_a_run_or_the_vehicles_own_log(
    viewer_there: httpx.Client, until: Until, run: str
) -> None:
    index = described(viewer_there, run, until)
    assert index["marks"][0]["text"] == "gust"
    assert (index["is_growing"], index["is_current"]) == (False, True)
    assert viewer_there.get(f"/replay/{run}").headers["content-type"].startswith("text/html")
    track = viewer_there.get(f"/api/replay/{run}/track")
    assert len(track.content) % (4 * index["track"]["width"]) == 0
    query: dict[str, Any] = {"start": 1.0, "end": 2.0, "signal": ["state.position.z", "thrust"]}
    window = viewer_there.get(f"/api/replay/{run}/window", params=query)
    length = int.from_bytes(window.content[:4], "little")
    [group] = json.loads(window.content[4 : 4 + length])["groups"]
    assert group["signals"] == query["signal"]
    at = viewer_there.get(f"/api/replay/{run}/at", params={"t": 2.0, "signal": "battery.voltage"})
    assert at.json()["battery.voltage"] == pytest.approx([15.998, 0.0], abs=0.02)


def test_a_spectrum_has_the_density_of_what_was_recorded_and_the_rotors(
    viewer_there: httpx.Client, until: Until
) -> None:
    described(viewer_there, RUN, until)
    query = {"start": "1", "end": "6", "signal": "imu/linear_acceleration.x"}
    answer = viewer_there.get(f"/api/replay/{RUN}/spectrum", params=query).json()
    [found] = answer["spectra"]
    assert found["frequency"][-1] == pytest.approx(250.0, abs=1.0)
    samples = 30.0 * SHORT.noise  # white, m/s^2
    level = float(np.sqrt(np.mean(np.square(found["density"][5:-5]))))
    assert level == pytest.approx(samples * np.sqrt(1.0 / 500.0), rel=0.15)
    assert len(answer["rotors"]) == 4
    answered = viewer_there.get(f"/api/replay/{RUN}/spectrum", params={**query, "end": "1.01"})
    assert answered.status_code == 422
    assert "too few" in answered.json()["error"]


def test_a_spectrogram_has_the_density_at_each_time_and_the_rotors(
    viewer_there: httpx.Client, until: Until
) -> None:
    described(viewer_there, RUN, until)
    query = {"start": "1", "end": "6", "signal": "imu/linear_acceleration.x"}
    found = viewer_there.get(f"/api/replay/{RUN}/spectrogram", params=query).json()
    density = np.array(found["density"])
    assert density.shape == (len(found["times"]), len(found["frequency"]))
    assert found["frequency"][-1] == pytest.approx(250.0, abs=1.0)
    assert 1.0 < found["times"][0] < 1.5
    assert 5.5 < found["times"][-1] < 6.0
    level = float(np.sqrt(np.mean(np.square(density[:, 5:-5]))))
    assert level == pytest.approx(30.0 * SHORT.noise * np.sqrt(1.0 / 500.0), rel=0.15)
    assert np.array(found["rotors"]).shape == (4, len(found["times"]))
    wrong = viewer_there.get(
        f"/api/replay/{RUN}/spectrogram", params={**query, "signal": "imu/nothing"}
    )
    assert "no signal" in wrong.json()["error"]


def test_a_viewer_gets_the_picture_at_an_instant_or_why_there_is_none(
    viewer_there: httpx.Client, until: Until
) -> None:
    described(viewer_there, RUN, until)

    def asked(camera: str, t: float) -> httpx.Response:
        place = f"/api/replay/{RUN}/picture"
        return viewer_there.get(place, params={"camera": camera, "t": t})

    found = asked("camera", 3.9)
    assert (found.content, found.headers["content-type"]) == (b"\xff\xd8 one", "image/jpeg")
    assert float(found.headers["x-time"]) == pytest.approx(3.0, abs=0.02)
    assert asked("camera", 1.0).status_code == 204
    assert asked("tracker", 3.9).status_code == 422
    assert "it has camera_picture" in asked("tracker", 3.9).json()["error"]
    assert asked("kitchen", 3.9).status_code == 422


def test_the_vehicles_own_logs_are_listed(viewer_there: httpx.Client) -> None:
    assert {one["id"] for one in viewer_there.get("/api/replay").json()} == {
        "onboard:quad1_flight",
        "onboard:quad2:quad2_flight",
        "onboard:quad3:here:quad3_flight",
    }


def test_an_empty_file_answers_in_one_line(viewer_there: httpx.Client, until: Until) -> None:
    answers: list[httpx.Response] = []

    def is_refused() -> bool:
        answers.append(viewer_there.get(f"/api/replay/{TORN}"))
        return answers[-1].status_code != 200

    until(is_refused, 60.0)
    assert 400 <= answers[-1].status_code < 500
    assert "is empty" in answers[-1].json()["error"]


@pytest.mark.parametrize(
    "name", ["unknown", "onboard:unknown", "onboard:..%2fruns%2fx", "onboard:", "%2e%2e%2fdoor"]
)
def test_no_name_leads_out_of_the_folders(viewer_there: httpx.Client, name: str) -> None:
    for path in ("", "/track", "/window?start=0&end=1&signal=a", "/at?t=0&signal=a"):
        answer = viewer_there.get(f"/api/replay/{name}{path}")
        assert answer.status_code == 404
        assert "\n" not in answer.json()["error"]


@pytest.mark.parametrize(
    "query",
    [
        "start=nan&end=1&signal=thrust",
        "start=0&end=inf&signal=thrust",
        "start=0&end=1",
        "start=0&end=1&signal=nothing",
        "start=0&end=1&signal=thrust&points=1000000",
        "start=0&end=1&" + "&".join(["signal=thrust"] * 65),
    ],
)
def test_what_cannot_be_asked_is_refused(
    viewer_there: httpx.Client, until: Until, query: str
) -> None:
    described(viewer_there, RUN, until)
    answer = viewer_there.get(f"/api/replay/{RUN}/window?{query}")
    assert answer.status_code == 422
    assert "\n" not in answer.json()["error"]


def test_others_are_answered_while_a_log_is_read(
    viewer_there: httpx.Client,
    replay_site: Any,
    serve: type,
    until: Until,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The build waits until another request has been answered."""
    heard = threading.Event()
    real = ReplayStore._run

    def slow(self: ReplayStore, log: Path, building: Building) -> None:
        assert heard.wait(20.0)
        real(self, log, building)

    monkeypatch.setattr(ReplayStore, "_run", slow)
    answer = viewer_there.get(f"/api/replay/{SECOND}")
    assert answer.json() == {"state": "building", "progress": 0.0}
    assert viewer_there.get("/api/summary").status_code == 200
    heard.set()
    described(viewer_there, SECOND, until)
