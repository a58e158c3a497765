"""The page that `quadlab log export LOG --format page` writes, opened from disk in Chromium."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from extensions.replay.reader import Replay
from quadlab.__main__ import main

BOUND = 60_000  # ms
AT = 5.0  # s
SPEED = "speed [km/h] = 3.6*norm(state.velocity.x, state.velocity.y)"
DRAWN = """canvas => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return new Set(new Uint32Array(data.buffer)).size;
}"""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "a <run>.mcap"
    return write_run(path, MadeRun(12.0, silence=(9.0, 10.0), marks=[(7.0, "gust")]))


@pytest.fixture(scope="module")
def exported(log: Path) -> Path:
    folder = log.parent / "page"
    words = ["log", "export", str(log), "--format", "page", "--out", str(folder)]
    assert main([*words, "--derive", SPEED]) == 0
    return folder


def test_the_page_opens_from_disk_with_the_runs_values_and_moves(
    exported: Path, log: Path, context: Any
) -> None:
    page = context.new_page()
    problems: list[str] = []
    asked: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{(exported / 'index.html').as_uri()}#t={AT:.3f}")
    page.wait_for_selector(f"main[data-shown='{AT:.3f}']", timeout=BOUND)
    [(z, _)] = Replay(log).at(["state.position.z"], AT).values()
    assert z is not None
    row = page.locator("#table tr", has_text="position").first.inner_text()
    assert f"{z:.3f}".replace("-", "−") in row
    for canvas in ("#view canvas", "#chart-0 canvas"):
        assert page.locator(canvas).first.evaluate(DRAWN) > 3, f"{canvas} is empty"
    page.click("#chart-0 button:text-is('Signals')")
    page.click("#chart-0 .menu.signals summary:has-text('derived')")
    page.locator("#chart-0 .menu.signals label:has-text('speed')").wait_for()  # one, once opened
    page.keyboard.press("Escape")
    box = page.locator("#line .bar").bounding_box()
    page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + 0.5 * box["height"])
    page.wait_for_function(
        f"Number(document.querySelector('main').dataset.shown) > {AT + 1.0}", timeout=BOUND
    )
    assert page.title().startswith("a <run>")
    assert page.locator("#plain-emergency, #head nav a").count() == 0
    assert problems == []
    assert all(url.startswith("file:") for url in asked)
    assert {url.rsplit("/", 1)[-1].split("#")[0] for url in asked} == {"index.html", "run.js"}


def test_a_page_is_never_written_over_and_has_the_whole_flight(
    exported: Path, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["log", "export", str(log), "--format", "page", "--out", str(exported)]
    assert main(words) != 0
    assert "is not empty; export into a new folder" in capsys.readouterr().err
    assert main([*words[:-1], str(log.parent / "b"), "--from", "2"]) == 2
    assert "leave out --topics, --from and --to" in capsys.readouterr().err
    assert main([*words[:-1], str(log.parent / "b"), "--derive", "v = stat"]) == 2
    assert "--derive 'v = stat': " in capsys.readouterr().err
    assert not (log.parent / "b").exists()
