"""Tables have the log's content, with units, in every format; a failure leaves no file."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from console import log_tables as tables
from extensions.export import export as exporting
from extensions.export import formats
from extensions.export.export import export
from flight_log import LogWriter
from quadlab.__main__ import main
from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError, UsageError
from vehicle_link.messages import encode, header, new

START = 1_769_851_842_123_456_789
COUNT = 300


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "run.mcap"
    with LogWriter(path, {"vehicle": "q", "experiment": "hover"}, {}) as writer:

        def write(topic: str, kind: str, k: int, **fields: Any) -> None:
            stamp = START + k * 10_000_000
            message = new(kind, header=header(stamp), **fields)
            writer.write(f"/q/{topic}", kind, encode(message), stamp + 5, stamp)

        for k in range(COUNT):
            pose = {"pose": {"position": [0.1 * k, 1.0 / 3.0, -k]}}
            write("state", "nav_msgs/Odometry", k, pose=pose)
            seen = 1 + k % 3
            write(
                "bearings",
                "quadlab_msgs/BearingArray",
                k,
                sigma=0.026,
                beacon_ids=list(range(seen)),
                bearings=[(0.0, 0.0, 1.0)] * seen,
            )
            write("status", "quadlab_msgs/VehicleStatus", k, mode="ready" if k < 100 else "armed")
    return path


@pytest.mark.parametrize("rows", [50, 100_000])
def test_parquet_holds_the_numbers_exactly_with_units(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int
) -> None:
    monkeypatch.setattr(tables, "ROWS", rows)
    done = export(log, tmp_path / "out", "parquet")
    assert (done.rows, done.problems) == (3 * COUNT, ())
    table = parquet.read_table(tmp_path / "out/state.parquet")
    x, y = (np.array(table[f"pose.pose.position.{axis}"]) for axis in "xy")
    assert x.tolist() == [0.1 * k for k in range(COUNT)]
    assert set(y.tolist()) == {1.0 / 3.0}
    assert table["stamp_ns"][7].as_py() == START + 70_000_000
    assert table["received_ns"][7].as_py() == START + 70_000_005
    assert np.array(table["time"])[7] == pytest.approx(0.07)
    assert table.schema.field("pose.pose.position.x").metadata == {b"unit": b"m"}
    assert b'"experiment": "hover"' in table.schema.metadata[b"quadlab.run"]


def test_texts_are_in_every_row_and_missing_members_are_nan(log: Path, tmp_path: Path) -> None:
    export(log, tmp_path / "out", "parquet", ["status", "bearings"])
    modes = parquet.read_table(tmp_path / "out/status.parquet")["mode"].to_pylist()
    assert modes == ["ready"] * 100 + ["armed"] * 200
    seen = parquet.read_table(tmp_path / "out/bearings.parquet")
    third = np.array(seen["bearings[2].z"])
    assert np.isnan(third).tolist() == [k % 3 < 2 for k in range(COUNT)]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "bearings.parquet",
        "status.parquet",
    ]


def test_csv_names_units_and_a_range_is_cut(log: Path, tmp_path: Path) -> None:
    assert export(log, tmp_path / "out", "csv", ["/q/state"], 1.0, 1.995).rows == 100
    with (tmp_path / "out/state.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 100
    assert float(rows[0]["time [s]"]) == pytest.approx(1.0)
    assert float(rows[0]["pose.pose.position.x [m]"]) == pytest.approx(10.0)
    assert "twist.twist.angular.z [rad/s]" in rows[0]


@pytest.mark.parametrize("compressed", [0, 10**9])
def test_matlab_has_a_struct_a_topic_with_units(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compressed: int
) -> None:
    monkeypatch.setattr(formats, "COMPRESSED_BYTES", compressed)
    [path] = export(log, tmp_path / "out", "mat").files
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    state = content["state"]
    assert state["pose_pose_position_x"][10] == pytest.approx(1.0)
    assert state["stamp_ns"][0] == START
    assert state["units"]["pose_pose_position_x"] == "m"
    assert content["run"]["experiment"] == "hover"
    assert content["status"]["mode"][150] == "armed"


@pytest.mark.needs("octave")
def test_octave_reads_the_structs_of_a_matlab_file(log: Path, tmp_path: Path) -> None:
    [path] = export(log, tmp_path / "out", "mat").files
    show = (
        f"r = load('{path}'); printf('%.17g %d %s %s %s', r.state.pose_pose_position_y(11), "
        "r.state.stamp_ns(1), r.state.units.pose_pose_position_y, r.run.experiment, "
        "r.status.mode{151});"
    )
    words = ["octave-cli", "--quiet", "--eval", show]
    said = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert said.stdout.split()[1:] == [str(START), "m", "hover", "armed"], said.stderr
    assert float(said.stdout.split()[0]) == 1.0 / 3.0


def test_more_than_a_matlab_file_is_made_of_is_refused_before_it_is_held(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "MAT_BYTES", 200_000)
    with pytest.raises(StorageError, match=r"0 MB of values.*--topics.*parquet") as refusal:
        export(log, tmp_path / "out", "mat")
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "out").exists()
    assert export(log, tmp_path / "out", "mat", ["status"], end=1.0).rows == 101


def test_a_wrong_word_makes_nothing(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(UsageError, match="no topic 'nix' in this log; there are bearings, state"):
        export(log, out, "csv", ["nix"])
    with pytest.raises(UsageError, match="give a --from below --to"):
        export(log, out, "csv", (), 2.0, 1.0)
    with pytest.raises(UsageError, match=r"--from 99: the log has 3\.0 s"):
        export(log, out, "csv", (), 99.0)
    assert not out.exists()


def test_nothing_is_overwritten(log: Path, tmp_path: Path) -> None:
    mine = tmp_path / "state.csv"
    mine.write_text("mine")
    with pytest.raises(UsageError, match="is not empty; export into a new folder"):
        export(log, tmp_path, "csv")
    assert [p.name for p in tmp_path.iterdir()] == ["state.csv"]
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_full_disk_leaves_no_file(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    def full(path: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(StorageError, match="No space left on device; nothing was exported"):
        export(log, tmp_path / "new" / "out", kind)
    assert list(tmp_path.iterdir()) == [], "nor the folders made for it"


LIMITED = """
import io, json, resource, sys
from contextlib import redirect_stderr, redirect_stdout
from quadlab.__main__ import main
log, *folders = sys.argv[1:]
told = []
for size in (0, 5000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    for folder in folders:
        words = ["log", "export", log, "--format", folder.split("/")[-2], "--out", folder]
        with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as error:
            status = main(words)
        told.append((folder, status, out.getvalue(), error.getvalue()))
print(json.dumps(told))
"""
"""Exports into files of at most 0 and 5000 bytes; the folder of FORMAT/FOLDER names the format."""


def test_a_disk_that_takes_so_many_bytes_is_left_as_it_was_and_the_next_try_works(
    log: Path, tmp_path: Path
) -> None:
    kinds = ("csv", "parquet", "mat")
    for kind in kinds:
        (tmp_path / kind / "mine").mkdir(parents=True)
    there = set(tmp_path.rglob("*"))
    folders = [str(tmp_path / kind / name) for kind in kinds for name in ("out", "mine")]
    words = [sys.executable, "-c", LIMITED, str(log), *folders]
    tried = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT, timeout=120)
    told = json.loads(tried.stdout)
    assert len(told) == 12
    for folder, status, out, error in told:
        assert (status, out) == (1, "")
        assert f"cannot write into {folder}: " in error
        assert "nothing was exported" in error
    assert set(tmp_path.rglob("*")) == there, "a folder that was there stays"
    for kind in kinds:
        assert export(log, tmp_path / kind / "mine", kind).rows == 900


def test_a_file_in_the_folders_place_stays_and_is_told(log: Path, tmp_path: Path) -> None:
    (tmp_path / "afile").write_text("mine")
    for out in (tmp_path / "afile", tmp_path / "afile" / "out"):
        with pytest.raises(StorageError, match="a file is there; choose a new folder with --out"):
            export(log, out, "csv")
    assert (tmp_path / "afile").read_text() == "mine"


def test_the_commands_say_what_they_did(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "check", str(log)]) == 0
    assert capsys.readouterr().out == "sound: 900 messages of 3 topics, read to the end\n"
    words = ["log", "export", str(log), "--topics", "state,status", "--out", str(tmp_path / "o")]
    assert main([*words, "--format", "parquet"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "600 rows in 2 files"
    assert main(["log", "info", str(log)]) == 0
    assert "  experiment: hover\n" in capsys.readouterr().out
    assert main(["log", "check", str(tmp_path)]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_a_format_of_another_extension_gets_the_pieces(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[str, int]] = []

    class Counted:
        def __init__(self, folder: Path, stem: str, run: Mapping[str, str]) -> None:
            self.path = folder / f"{stem}.count"

        def write(self, piece: tables.Piece) -> None:
            seen.append((piece.topic, piece.table.num_rows))

        def finish(self) -> list[Path]:
            return [self.path]

        def discard(self) -> None:
            raise AssertionError("nothing failed")

    offered = SimpleNamespace(load=lambda: Counted)
    registry = SimpleNamespace(offers=lambda _: {"count": offered})
    monkeypatch.setattr(exporting, "registry", lambda: registry)
    done = export(log, tmp_path / "out", "count", ["state"])
    assert seen == [("state", done.rows)]
    assert done.files == (tmp_path / "out" / "run.count",)
    with pytest.raises(UsageError, match="unknown format 'csv'; there are count"):
        export(log, tmp_path / "other", "csv")
