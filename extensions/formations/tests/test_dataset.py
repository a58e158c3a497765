"""The dataset of formation flights: its tables, and bad input."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from pyarrow import parquet

from extensions.formations import dataset
from extensions.formations.dataset import TOPICS, Dataset, write_tables
from flight_log import LogWriter
from quadlab.__main__ import main
from quadlab.simulated import together
from vehicle_link.messages import encode, header, new


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--flights", "0"], "--flights 0; allowed are 1 to 1000"),
        (["--vehicles", "9"], "9"),
        (["--vehicles", "2"], "--vehicles 2: formation is flown by 3 to 8 vehicles"),
    ],
)
def test_what_cannot_be_flown_is_one_line_and_makes_nothing(
    words: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["formations", str(out), *words]) == 2
    told = capsys.readouterr().err.strip()
    assert line in told
    assert "\n" not in told
    assert not out.exists()


def test_a_folder_that_exists_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["formations", str(tmp_path)]) == 2
    assert f"{tmp_path} exists; give a new folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_each_flight_has_a_row_and_one_that_failed_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[tuple[Path, Path]] = []

    def flown(experiment: str, count: int, *, seed: int, words: object, out: Path) -> object:
        folder = out / f"{experiment}_seed{seed}_x{count}"
        folder.mkdir(parents=True)
        logs = {f"quad{k + 1}": folder / f"quad{k + 1}.mcap" for k in range(count)}
        verdict = "failed" if seed == 4 else "passed"
        return SimpleNamespace(
            folder=folder, logs=logs, verdict=verdict, reason="", metrics={"collisions": 0.0}
        )

    monkeypatch.setattr(together, "fly_together", flown)
    monkeypatch.setattr(dataset, "write_tables", lambda log, to: written.append((log, to)))
    out = tmp_path / "out"
    assert Dataset(out, flights=2, vehicles=3, seed=3).run() == 1
    rows = json.loads((out / "flights.json").read_text())
    assert [(row["seed"], row["verdict"]) for row in rows] == [(3, "passed"), (4, "failed")]
    assert rows[0]["figures"] == {"collisions": 0.0}
    assert len(written) == 6
    assert written[0][1] == out / "formation_seed3_x3" / "parquet" / "quad1"
    described = (out / "README.md").read_text()
    assert all(f"- {topic}: " in described for topic in TOPICS)


def test_the_tables_are_those_topics_that_the_log_has(tmp_path: Path) -> None:
    log, stamp = tmp_path / "quad1.mcap", 1_000_000_000
    kind = "quadlab_msgs/BearingArray"
    with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
        for topic in ("neighbour_bearings", "bearings"):
            fields = {"beacon_ids": [2], "bearings": [(0.0, 0.6, 0.8)], "sigma": 0.026}
            message = new(kind, header=header(stamp), **fields)
            writer.write(f"/quad1/{topic}", kind, encode(message), stamp, stamp)
    files = write_tables(log, tmp_path / "parquet" / "quad1")
    assert [file.name for file in files] == ["neighbour_bearings.parquet"]
    [row] = parquet.read_table(files[0]).to_pylist()
    assert (row["beacon_ids[0]"], row["bearings[0].z"], row["sigma"]) == (2.0, 0.8, 0.026)
