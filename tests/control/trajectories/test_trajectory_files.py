"""Trajectories from files: they are read as written, and each mistake is one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from control.trajectories.csv_file import COLUMNS, DERIVATIVES, load_csv
from control.trajectories.feasibility import examine
from control.trajectories.figure_eight import FigureEight
from control.trajectories.library import files_of, load_files, load_trajectory
from control.trajectories.limits import Limits
from control.trajectories.python_file import load_python
from control.trajectories.trajectory import Trajectory, sample_many, stretches_of
from quadrotor.checkout import ROOT
from quadrotor.errors import RefusedError, StorageError
from quadrotor.vehicle_model import VehicleModel
from tests.support.arrays import Array

EXAMPLES = ROOT / "examples" / "trajectories"
CHAIN = ["position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"]
YAW_CHAIN = ["yaw", "yaw_rate", "yaw_acceleration"]
EIGHT = FigureEight((0.5, -0.5, 1.2), 3.0, period=6.0, laps=2, ramp=3.0)


def table(
    path: FigureEight, times: Array, names: tuple[str, ...] = (*COLUMNS, *DERIVATIVES)
) -> tuple[str, Array]:
    """Return rows of a trajectory under these column names."""
    s = sample_many(path, times)
    columns = {"t": times, "yaw": (s["yaw"] + np.pi) % (2 * np.pi) - np.pi}
    columns |= {"yaw_rate": s["yaw_rate"], "yaw_acceleration": s["yaw_acceleration"]}
    for letter, field in zip(("", "v", "a", "j", "s"), CHAIN, strict=True):
        for k, axis in enumerate("xyz"):
            columns[letter + axis] = s[field][:, k]
    return ",".join(names), np.stack([columns[name] for name in names], axis=1)


def write(path: Path, header: str, rows: Array) -> Path:
    path.write_text("\n".join([header, *(",".join(map(repr, r)) for r in rows.tolist())]) + "\n")
    return path


def test_a_csv_with_all_derivatives_comes_back_as_it_was(tmp_path: Path) -> None:
    times = np.linspace(0.0, EIGHT.duration, 301)
    path = load_csv(write(tmp_path / "eight.csv", *table(EIGHT, times)))
    assert path.duration == pytest.approx(EIGHT.duration)
    t = np.linspace(0.0, EIGHT.duration, 1777)
    wanted, found = sample_many(EIGHT, t), sample_many(path, t)
    for field, off in zip(CHAIN, (1e-9, 1e-8, 1e-6, 1e-4, 1e-2), strict=True):
        np.testing.assert_allclose(found[field], wanted[field], atol=off, err_msg=field)
    np.testing.assert_allclose(np.cos(found["yaw"] - wanted["yaw"]), 1.0, atol=1e-9)
    np.testing.assert_allclose(found["yaw_rate"], wanted["yaw_rate"], atol=1e-4)


def test_a_csv_of_positions_is_flown_through_its_rows_with_continuous_snap(tmp_path: Path) -> None:
    times = np.linspace(0.0, EIGHT.duration, 151) + 17.0  # any start time
    header, rows = table(EIGHT, times - 17.0, COLUMNS)
    rows[:, 0] += 17.0
    path = load_csv(write(tmp_path / "eight.csv", header, rows))
    at_rows = sample_many(path, times - 17.0)
    np.testing.assert_allclose(at_rows["position_w"], rows[:, 1:4], atol=1e-9)
    np.testing.assert_allclose(np.cos(at_rows["yaw"] - rows[:, 4]), 1.0, atol=1e-9)
    assert np.abs(np.diff(at_rows["yaw"])).max() < 0.5  # unwrapped
    t = np.linspace(0.0, EIGHT.duration, 1777)
    wanted, found = sample_many(EIGHT, t), sample_many(path, t)
    for field, off in zip(CHAIN, (1e-4, 1e-3, 1e-2, 0.05, 1.0), strict=True):
        np.testing.assert_allclose(found[field], wanted[field], atol=off, err_msg=field)
    before, after = (sample_many(path, times[1:-1] - 17.0 + d) for d in (-1e-9, 1e-9))
    for field in (*CHAIN, *YAW_CHAIN):
        np.testing.assert_allclose(before[field], after[field], atol=1e-5, err_msg=field)
    for end in (0.0, path.duration):
        for field in CHAIN[1:] + YAW_CHAIN[1:]:
            still = sample_many(path, np.array([end]))[field]
            np.testing.assert_allclose(still, 0.0, atol=1e-6)


def test_comments_blank_lines_spaces_a_byte_mark_and_any_order_of_columns_are_read(
    tmp_path: Path,
) -> None:
    file = tmp_path / "a.csv"
    text = "\ufeff# a line\n\n yaw , t,z,y,x\n0,0,1,0,0\n# here\n0.5, 10 ,1.5,2,1\n,,,,\n"
    file.write_text(text, encoding="utf-8")
    ends = sample_many(load_csv(file), np.array([0.0, 10.0]))
    np.testing.assert_allclose(ends["position_w"], [[0.0, 0.0, 1.0], [1.0, 2.0, 1.5]], atol=1e-12)
    np.testing.assert_allclose(ends["yaw"], [0, 0.5], atol=1e-12)


GOOD = "t,x,y,z,yaw\n0,0,0,1,0\n9,0,0,2,0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "0 rows of numbers"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n", "1 rows of numbers"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n9,0,up,2,0\n", "line 3, column y: 'up' is not a finite number"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n9,0,0,2,nan\n", "line 3, column yaw: 'nan' is not a finite"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n9,0,0,2\n", "line 3: 4 values for 5 columns"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n0,0,0,2,0\n", "line 3, column t: 0 s comes after 0 s"),
        ("t,x,y,z,psi\n", "line 1, column 5: 'psi' is not a column's name; there are t, x"),
        ("t,x,y,z,z\n", "line 1, column 4: z is there twice"),
        ("t,x,y,z\n", "line 1: column yaw is missing"),
        ("t,x,y,z,yaw,vx\n", "column vy, vz, ax.* is missing; .*all or none"),
        ("0,0,0,1,0\n", "line 1, column 1: '0' is not a column's name"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n1,2,0,1,0\n9,2,0,1,0\n", "2.00 m/s between the first two rows"),
        ("t,x,y,z,yaw\n0,0,0,1,0\n9,0,0,1,0\n10,0,0,2,0\n", "1.00 m/s between the last two rows"),
    ],
)
def test_each_mistake_in_a_csv_is_named_with_its_place(
    tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "path.csv"
    file.write_text(GOOD)
    assert load_csv(file).duration == 9.0
    file.write_text(text)
    with pytest.raises(RefusedError, match=message) as refused:
        load_csv(file)
    assert str(refused.value).startswith("path.csv")
    assert "\n" not in str(refused.value)


def test_a_csv_with_derivatives_that_starts_in_motion_is_refused(tmp_path: Path) -> None:
    times = np.linspace(4.0, 8.0, 41)
    file = write(tmp_path / "part.csv", *table(EIGHT, times))
    with pytest.raises(RefusedError, match=r"part.csv: starts with a velocity of .* at 0 s"):
        load_csv(file)


PYTHON = """
import numpy as np

class Rises:
    duration = 4.0

    def sample(self, t, r):
        x = min(1.0, max(0.0, t / 4.0))
        s = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
        r["yaw"] = r["yaw_rate"] = r["yaw_acceleration"] = 0.0
        for k, name in enumerate(("position", "velocity", "acceleration", "jerk", "snap")):
            r[name + "_w"] = (0.0, 0.0, (s.deriv(k) if k else s)(x) / 4.0**k)
        # here

"""


@pytest.mark.parametrize(
    "last", ["trajectory = Rises", "trajectory = Rises()", "trajectory = make"]
)
def test_a_python_file_gives_its_trajectory_as_a_class_an_object_or_a_function(
    tmp_path: Path, last: str
) -> None:
    file = tmp_path / "rises.py"
    file.write_text(PYTHON + "def make():\n    return Rises()\n" + last + "\n")
    path = load_python(file)
    space: dict[str, type[Trajectory]] = {}
    exec(PYTHON, space)
    t = np.linspace(-0.5, 4.5, 333)
    wanted, found = sample_many(space["Rises"](), t), sample_many(path, t)
    for field, off in zip(CHAIN, (1e-12, 1e-9, 1e-7, 1e-5, 1e-3), strict=True):
        np.testing.assert_allclose(found[field], wanted[field], atol=off, err_msg=field)


def test_a_python_file_may_use_dataclasses_with_written_annotations(tmp_path: Path) -> None:
    file = tmp_path / "data.py"
    head = "from __future__ import annotations\nfrom dataclasses import dataclass\n"
    made = "@dataclass\nclass trajectory(Rises):\n    height: float = 1.0\n"
    file.write_text(head + PYTHON + made)
    assert load_python(file).duration == 4.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = (", r"line 1: SyntaxError: '\(' was never closed"),
        ("a = 1\nb = a / 0\n", "line 2: ZeroDivisionError: division by zero"),
        ("import nothing_of_this_name\n", "line 1: ModuleNotFoundError: No module named"),
        ("raise SystemExit(3)\n", "line 1: SystemExit: 3"),
        ("pass\n", "defines no 'trajectory'"),
        ("trajectory = 3\n", "trajectory is int, which has no sample"),
        ("def trajectory():\n    return 3\n", r"what trajectory makes \(int\) has no duration"),
        ("class trajectory:\n    duration = 1.0\n", "has no sample"),
        ("def trajectory(a):\n    return a\n", "TypeError: .*missing 1 required positional"),
        (PYTHON + "class trajectory(Rises):\n    duration = -1.0\n", "a duration of -1 s; allowed"),
        (PYTHON + "class trajectory(Rises):\n    duration = float('inf')\n", "a duration of inf s"),
        (
            PYTHON + "class trajectory(Rises):\n    duration = 'long'\n",
            "ValueError: could not conv",
        ),
        (PYTHON.replace("# here", "1 / 0") + "trajectory = Rises", "line 13: ZeroDivisionError"),
        (
            PYTHON.replace("# here", "r['jerk_w'][0, 1] = np.nan if t > 2 else 0")
            + "trajectory = Rises",
            "jerk_w is not finite at 2.01 s",
        ),
        (
            PYTHON.replace("# here", "r['velocity_w'] *= 0.5") + "trajectory = Rises",
            "velocity_w is not the derivative of position_w at",
        ),
        (
            PYTHON.replace("# here", "r['yaw'] = 0.1 * t") + "trajectory = Rises",
            "yaw_rate is not the derivative of yaw at 0.01 s: the one moves by 0.1 per second",
        ),
        (
            PYTHON.replace("# here", "r['yaw'] = 0.1 * t; r['yaw_rate'] = 0.1")
            + "trajectory = Rises",
            r"starts with a velocity of 0.1 \(SI\) at 0 s",
        ),
    ],
)
def test_each_mistake_in_a_python_file_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text(text)
    with pytest.raises(RefusedError, match=message) as refused:
        load_python(file)
    assert str(refused.value).startswith("mine.py")
    assert "\n" not in str(refused.value)


def test_a_folder_gives_what_loads_and_says_what_does_not(tmp_path: Path) -> None:
    (tmp_path / "good.csv").write_text(GOOD)
    (tmp_path / "bad.csv").write_text("t,x\n")
    (tmp_path / "rises.py").write_text(PYTHON + "trajectory = Rises")
    (tmp_path / "rises.csv").write_text(GOOD)
    (tmp_path / "_helper.py").write_text("raise ValueError")
    (tmp_path / "notes.txt").write_text("no trajectory")
    loaded, refused = load_files(files_of(tmp_path))
    assert sorted(loaded) == ["good", "rises"]
    assert refused == [
        "bad.csv, line 1: column y, z, yaw is missing; give t, x, y, z, yaw, and of the "
        "derivatives all or none",
        "rises.py: there is another file called rises",
    ]
    with pytest.raises(StorageError, match="cannot be read"):
        files_of(tmp_path / "none")


def test_files_of_no_kind_and_files_that_cannot_be_read_are_said(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=r"a.txt: .txt is not a kind of trajectory file"):
        load_trajectory(tmp_path / "a.txt")
    for name in ("a.csv", "a.py"):
        with pytest.raises(StorageError, match="cannot be read"):
            load_trajectory(tmp_path / name)
        (tmp_path / name).write_bytes(b"\xff\xfe\x00t")
        with pytest.raises(StorageError, match=r"cannot be read.*text"):
            load_trajectory(tmp_path / name)


def test_a_long_file_is_looked_at_in_flight_as_closely_as_at_its_loading(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    # A quarter of an hour of slow laps, with one brief swing.
    times = np.arange(0.0, 900.0, 0.25)
    slow = FigureEight((0.0, 0.0, 1.5), yaw_amplitude=0.0, period=60.0, laps=14, ramp=20.0)
    header, rows = table(slow, times, COLUMNS)
    when = float(rng.uniform(100.0, 700.0))
    rows[:, 1] += 0.1 * np.exp(-(((times - when) / 0.4) ** 2))
    file = write(tmp_path / "long.csv", header, rows)
    path = load_trajectory(file)
    assert sum(count for _, _, count in stretches_of(path)) < 1200
    model = VehicleModel().record()
    seen, whole = examine(path, model, Limits()), examine(load_csv(file), model, Limits())
    for a, b in zip(seen.extremes, whole.extremes, strict=True):
        assert a.value == pytest.approx(b.value, abs=1e-3 * (1e-3 + abs(b.value))), a.name
    assert abs(seen.of("acceleration").time - when) < 1.0
    limits = Limits(acceleration=0.6 * whole.of("acceleration").value)
    first, again = (examine(p, model, limits).breach for p in (path, load_csv(file)))
    assert first is not None
    assert again is not None
    assert first.first == pytest.approx(again.first, abs=5e-3)
    moved = path.moved((1.0, 2.0, 1.0, 0.4)).slowed(2.0)
    assert examine(moved, model, Limits()).of("acceleration").value == pytest.approx(
        whole.of("acceleration").value / 4.0, rel=1e-3
    )


def test_the_examples_load() -> None:
    loaded, refused = load_files(files_of(EXAMPLES))
    assert refused == []
    assert set(loaded) == {"clover", "spiral"}
