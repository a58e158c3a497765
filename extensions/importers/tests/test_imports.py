"""A flight of another system becomes a run: units, frames and clocks are found or refused."""

from __future__ import annotations

import re
import resource
import sqlite3
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from zstandard import ZstdCompressor

from estimation.sweep_angles import plane_numbers, swept
from extensions.importers.flight import ImportedFlight
from extensions.importers.frames import axes
from extensions.importers.importing import NewRun, read_flight
from extensions.importers.mapping import load_mapping, names
from extensions.importers.readers import tables, text_table
from extensions.importers.readers.text_table import TextTable
from extensions.importers.sweeps import SENSORS_B, read_stations
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.crazyflie_writer import Event, write_crazyflie, write_events
from extensions.importers.tests.foreign_flight import (
    FRD,
    NED,
    ForeignFlight,
    columns_of,
    make_flight,
    write_csv,
    write_mapping,
)
from extensions.importers.tests.ulog_writer import write_ulog
from extensions.importers.trajectory import world_turn
from extensions.offline.lines import plan_runs
from extensions.offline.run import replay
from flight_log import check, limits
from quadlab.__main__ import main
from quadlab.recording.log import read_recording
from quadrotor.errors import LogFormatError, QuadlabError, StorageError, UsageError
from quadrotor.records import SWEEPS_SAMPLE, Array

FLIGHT = make_flight()


def imported(
    folder: Path, columns: dict[str, Array], imu: str = "", truth: str = ""
) -> ImportedFlight:
    path = write_csv(folder / "flight.csv", columns)
    return read_flight(path, str(write_mapping(folder / "mapping.toml", imu, truth)))


def turned(
    flight: ForeignFlight, body: Array | None = None, world: Array | None = None
) -> ForeignFlight:
    """Return the flight with its vectors in the axes of another body and another world."""
    from scipy.spatial.transform import Rotation

    body = np.eye(3) if body is None else body
    world = np.eye(3) if world is None else world
    return ForeignFlight(
        flight.seconds,
        flight.position @ world.T,
        flight.velocity @ world.T,
        Rotation.from_matrix(world @ flight.rotation.as_matrix() @ body.T),
        flight.force @ body.T,
        flight.rate @ body.T,
    )


def is_the_flight(found: ImportedFlight, offset: float = 0.0) -> None:
    """Check an import against the flight."""
    assert found.truth is not None
    assert np.allclose(found.imu.specific_force_b, FLIGHT.force, atol=1e-6)
    assert np.allclose(found.imu.angular_velocity_b, FLIGHT.rate, atol=1e-6)
    assert np.allclose(found.truth.states["position_w"], FLIGHT.position, atol=1e-6)
    same = np.abs((found.truth.states["quaternion_wb"] * FLIGHT.quaternion).sum(axis=1))
    assert same.min() > 1.0 - 1e-9
    late = (found.truth.stamps_ns - found.imu.stamps_ns) * 1e-9
    assert np.abs(late - offset).max() < 2e-3
    inner = slice(10, -10)
    velocity = found.truth.states["velocity_w"] - FLIGHT.velocity
    assert np.abs(velocity[inner]).max() < 0.01


def test_what_a_mapping_leaves_out_is_found(tmp_path: Path) -> None:
    columns = columns_of(turned(FLIGHT, FRD, NED))
    for name in ("ax", "ay", "az"):
        columns[name] = columns[name] / 9.80665
    for name in ("gx", "gy", "gz"):
        columns[name] = np.degrees(columns[name])
    found = imported(tmp_path, columns)
    is_the_flight(found)
    told = "; ".join(found.notes)
    for word in ("in g", "in deg/s", "FRD", "NED", "wxyz"):
        assert word in told


def test_stated_units_and_frames_that_are_right_are_taken(tmp_path: Path) -> None:
    imu = 'angular_velocity_unit = "rad/s"\nspecific_force_unit = "m/s^2"\nbody = "FLU"'
    truth = 'quaternion_order = "wxyz"\nworld = "ENU"\nbody = "FLU"\nposition_unit = "m"'
    is_the_flight(imported(tmp_path, columns_of(FLIGHT), imu, truth))


@pytest.mark.parametrize(
    ("imu", "truth", "hint"),
    [
        ('specific_force_unit = "g"', "", "m/s^2"),
        ('angular_velocity_unit = "deg/s"', "", "rad/s"),
        ('body = "FRD"', "", "FLU"),
        ("", 'world = "NED"', "ENU"),
        ("", 'body = "FRD"', "FLU"),
        ("", 'quaternion_order = "xyzw"', "wxyz"),
        ("", 'quaternion_maps = "world to body"', "body to world"),
        ("", 'position_unit = "mm"', '"m"'),
        ('body = "FLL"', "", "FRD"),
    ],
)
def test_a_stated_unit_or_frame_that_is_wrong_is_refused_with_what_fits(
    tmp_path: Path, imu: str, truth: str, hint: str
) -> None:
    with pytest.raises(QuadlabError) as refused:
        imported(tmp_path, columns_of(FLIGHT), imu, truth)
    assert hint in str(refused.value)
    assert "\n" not in str(refused.value)


def test_stamps_of_the_truth_that_are_late_are_corrected_and_told(tmp_path: Path) -> None:
    columns = columns_of(FLIGHT)
    write_csv(tmp_path / "truth.csv", {**columns, "t": columns["t"] + 0.137})
    found = imported(tmp_path, columns, truth='file = "truth.csv"')
    is_the_flight(found)
    assert any("late" in note for note in found.notes)
    kept = imported(tmp_path, columns, truth='file = "truth.csv"\ntime_offset = 0.0')
    is_the_flight(kept, 0.137)


def test_a_truth_mounted_slightly_askew_is_corrected_and_told(tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    askew = turned(FLIGHT, Rotation.from_rotvec([0.011, -0.004, 0.003]).as_matrix())
    columns = columns_of(FLIGHT)
    columns |= {name: column for name, column in columns_of(askew).items() if name[0] == "q"}
    found = imported(tmp_path, columns)
    assert found.truth is not None
    same = np.abs((found.truth.states["quaternion_wb"] * FLIGHT.quaternion).sum(axis=1))
    assert np.degrees(2.0 * np.arccos(np.minimum(same, 1.0))).max() < 0.1  # it was 0.7
    assert any(
        re.search(r"body is turned by 0\.\d+ ± 0\.\d+ deg .*: corrected", note)
        for note in found.notes
    )


def largest_turn(found: ImportedFlight) -> float:
    """Return the largest angle, in degrees, of the imported truth's attitude to the flight's."""
    assert found.truth is not None
    at = found.truth.stamps_ns - found.imu.stamps_ns[0]
    true = FLIGHT.quaternion[np.round(at / 1e7).astype(int)]
    same = np.abs((found.truth.states["quaternion_wb"] * true).sum(axis=1))
    return float(np.degrees(2.0 * np.arccos(np.minimum(same, 1.0))).max())


@pytest.mark.parametrize("askew", [0.0, 1.0])
@pytest.mark.parametrize("seconds", [30.0, 14.0])
def test_a_gyroscopes_bias_is_no_turn_of_the_truths_body(
    tmp_path: Path, askew: float, seconds: float
) -> None:
    from scipy.spatial.transform import Rotation

    columns = columns_of(FLIGHT)
    other = turned(FLIGHT, Rotation.from_rotvec([0.0, 0.0, np.radians(askew)]).as_matrix())
    columns |= {name: column for name, column in columns_of(other).items() if name[0] == "q"}
    columns |= {"gx": columns["gx"] - 0.002, "gy": columns["gy"] + 0.02, "gz": columns["gz"] + 0.08}
    rows = round(seconds / 0.01)
    found = imported(tmp_path, {name: column[:rows] for name, column in columns.items()})
    assert largest_turn(found) < 0.1
    assert any("corrected" in note for note in found.notes) == (askew > 0.0)


def test_a_replay_takes_the_bias_at_rest_off_or_says_which_bound_holds_it(tmp_path: Path) -> None:
    bias = np.array([-0.01, 0.03, 0.08])
    columns = columns_of(FLIGHT)
    columns |= {
        f"g{axis}": columns[f"g{axis}"] + one for axis, one in zip("xyz", bias, strict=True)
    }
    flying = imported(tmp_path, columns)
    read = read_recording(NewRun(flying, tmp_path / "flight.csv").write(tmp_path, "flying"))
    assert read.notes == [
        "the log begins without a second at rest: the gyroscope's bias is not taken off"
    ]
    [run] = plan_runs(read, (), ["error_state"], (), "poses")
    held = replay(read, run, read.poses).held()
    assert list(held) == ["estimation.gyroscope_bias_limit"]
    assert held["estimation.gyroscope_bias_limit"] > 20.0

    random = np.random.default_rng(7)
    rest = {name: np.zeros(300) for name in columns} | {"az": np.full(300, 9.81)}
    rest["t"] = columns["t"][0] - 3.0 + 0.01 * np.arange(300)
    for axis, one in zip("xyz", bias, strict=True):
        rest[f"g{axis}"] = one + random.normal(0.0, 0.002, 300)
    joined = {name: np.concatenate([rest[name], columns[name]]) for name in columns}
    mapping = write_mapping(tmp_path / "m.toml", 'angular_velocity_unit = "rad/s"')
    mapping.write_text(mapping.read_text().partition("[truth]")[0])
    path = write_csv(tmp_path / "rested.csv", joined)
    read = read_recording(NewRun(read_flight(path, str(mapping)), path).write(tmp_path, "rested"))
    assert np.allclose(read.imu["angular_velocity_b"][300:], FLIGHT.rate, atol=1e-3)
    assert "found at rest" in read.notes[0]


def test_a_turn_and_an_offset_below_their_standard_errors_are_told_and_not_corrected(
    tmp_path: Path,
) -> None:
    from scipy.spatial.transform import Rotation

    random = np.random.default_rng(5)
    noise = Rotation.from_rotvec(np.radians(2.0) * random.normal(size=(len(FLIGHT.seconds), 3)))
    noisy = (FLIGHT.rotation * noise).as_quat()[:, [3, 0, 1, 2]]
    columns = columns_of(FLIGHT)
    columns |= {f"q{item}": noisy[:, k] for k, item in enumerate("wxyz")}
    columns |= {name: column[:1200] for name, column in columns.items()}
    found = imported(tmp_path, columns)
    assert not any("corrected" in note for note in found.notes)
    assert any("±" in note for note in found.notes)
    assert found.truth is not None
    assert np.array_equal(found.truth.stamps_ns, found.imu.stamps_ns)


def test_a_clock_that_runs_faster_is_told_with_the_scale_that_corrects_it(tmp_path: Path) -> None:
    columns = columns_of(FLIGHT)
    start = columns["t"][0]
    fast = start + 1.002 * (columns["t"] - start)
    write_csv(tmp_path / "truth.csv", {**columns, "t": fast})
    found = imported(tmp_path, columns, truth='file = "truth.csv"')
    (told,) = (note for note in found.notes if "time_scale" in note)
    (scale,) = re.findall(r"time_scale = (\S+)", told)
    assert float(scale) == pytest.approx(1.0 / 1.002, abs=5e-5)


EULER = 'euler = ["yaw", "pitch", "roll"]\neuler_order = "{}"\neuler_unit = "{}"'


def with_euler(folder: Path, truth: str) -> ImportedFlight:
    """Import the flight with its attitudes as Euler angles (deg) under names in capitals."""
    columns = {name: one for name, one in columns_of(FLIGHT).items() if name[0] != "q"}
    angles = FLIGHT.rotation.as_euler("ZYX", degrees=True)
    columns |= {name: angles[:, k] for k, name in enumerate(("Yaw", "Pitch", "Roll"))}
    path = write_csv(folder / "flight.csv", {one.upper(): columns[one] for one in columns})
    mapping = write_mapping(folder / "mapping.toml", truth=truth)
    quaternion = 'quaternion = ["qw", "qx", "qy", "qz"]\n'
    mapping.write_text(mapping.read_text().replace(quaternion, ""))
    return read_flight(path, str(mapping))


def test_attitudes_may_be_euler_angles_and_names_in_capitals(tmp_path: Path) -> None:
    is_the_flight(with_euler(tmp_path, EULER.format("ZYX", "deg")))


@pytest.mark.parametrize(
    ("truth", "hint"),
    [
        (EULER.format("XYZ", "deg"), "are euler_order and euler_unit right"),
        (EULER.format("ZYX", "rad"), "are euler_order and euler_unit right"),
        (EULER.format("ZZX", "deg"), "euler_order 'ZZX'"),
        (EULER.format("ZyX", "deg"), "euler_order 'ZyX'"),
        ('euler = ["yaw", "pitch", "roll"]\neuler_order = "ZYX"', "euler needs euler_unit"),
        ('euler_unit = "deg"', "euler_unit without euler"),
        (EULER.format("ZYX", "deg") + "\nquaternion = [0, 1, 2, 3]", "give one of them"),
        (EULER.format("ZYX", "turns"), "euler_unit"),
    ],
)
def test_wrong_euler_angles_are_refused_in_one_line(tmp_path: Path, truth: str, hint: str) -> None:
    with pytest.raises(QuadlabError) as refused:
        with_euler(tmp_path, truth)
    assert hint in str(refused.value)
    assert "\n" not in str(refused.value)


def test_capitals_matter_where_two_columns_differ_by_them(tmp_path: Path) -> None:
    columns = columns_of(FLIGHT)
    columns = {"GX": 0.0 * columns["gx"], **columns}
    is_the_flight(imported(tmp_path, columns))
    columns = {"Gx" if name == "gx" else name: one for name, one in columns.items()}
    with pytest.raises(LogFormatError, match="'gx'; did you mean"):
        imported(tmp_path, columns)


def test_two_clocks_are_refused_with_the_offset_that_fits(tmp_path: Path) -> None:
    columns = columns_of(FLIGHT)
    write_csv(tmp_path / "truth.csv", {**columns, "t": columns["t"] - columns["t"][0]})
    with pytest.raises(LogFormatError, match=r"time_offset = 1700000000\.0"):
        imported(tmp_path, columns, truth='file = "truth.csv"')
    is_the_flight(imported(tmp_path, columns, truth='file = "truth.csv"\ntime_offset = 1.7e9'))


def test_a_log_without_truth_is_imported_and_says_so(tmp_path: Path) -> None:
    mapping = write_mapping(tmp_path / "m.toml", 'angular_velocity_unit = "rad/s"')
    mapping.write_text(mapping.read_text().partition("[truth]")[0])
    found = read_flight(write_csv(tmp_path / "f.csv", columns_of(FLIGHT)), str(mapping))
    assert found.truth is None
    assert any("no truth" in note for note in found.notes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c | {"t": np.roll(c["t"], 1)}, "go back"),
        (lambda c: c | {"t": 0.0 * c["t"]}, "stamp"),
        (lambda c: {k: v[:20] for k, v in c.items()}, "rows"),
        (lambda c: {k: v for k, v in c.items() if k != "ax"}, "'ax'"),
        (lambda c: c | {"az": c["az"] - 9.8}, "gravity"),
        (lambda c: c | {"qw": c["qw"] + 3.0}, "unit quaternions"),
        (lambda c: c | {"gx": c["gz"] ** 2, "gy": c["gx"], "gz": c["gy"]}, "turning"),
        (lambda c: c | {"px": c["py"], "py": -c["pz"], "pz": c["px"]}, "world"),
    ],
)
def test_what_no_flight_can_be_made_of_is_refused_in_one_line(
    tmp_path: Path, change: object, words: str
) -> None:
    assert callable(change)
    with pytest.raises(LogFormatError) as refused:
        imported(tmp_path, change(columns_of(FLIGHT)))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_half_a_file_is_refused_and_its_whole_lines_imported_when_asked(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "flight.csv", columns_of(FLIGHT))
    path.write_bytes(path.read_bytes()[:300_000].rsplit(b",", 1)[0])
    mapping = str(write_mapping(tmp_path / "m.toml"))
    with pytest.raises(LogFormatError, match="is incomplete"):
        read_flight(path, mapping)
    whole = path.read_text().count("\n") - 1
    assert len(read_flight(path, mapping, torn=True).imu.stamps_ns) == whole


def test_hdf5_by_columns_of_its_datasets(tmp_path: Path) -> None:
    path = tmp_path / "data.hdf5"
    flight = turned(FLIGHT, FRD)
    with h5py.File(path, "w") as file:
        file["ts"], file["gyro_raw"], file["accel_raw"] = flight.seconds, flight.rate, flight.force
        file["traj_target"] = np.concatenate(
            [flight.position, flight.quaternion[:, [1, 2, 3, 0]]], axis=1
        )
    is_the_flight(read_flight(path, "blackbird"))
    path.write_bytes(path.read_bytes()[:50_000])
    with pytest.raises(LogFormatError):
        read_flight(path, "blackbird")


def _claiming_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, width in (("ts", ()), ("gyro_raw", (3,)), ("accel_raw", (3,))):
            shape = (5_000_000_000, *width)
            file.create_dataset(name, shape, "f8", chunks=True, compression="gzip")


def _claiming_numpy(path: Path) -> None:
    with path.open("wb") as file:
        shape = {"descr": "<f8", "fortran_order": False, "shape": (5_000_000_000, 7)}
        np.lib.format.write_array_header_1_0(file, shape)


@pytest.mark.parametrize("make", [_claiming_hdf5, _claiming_numpy])
def test_a_small_file_that_claims_gigabytes_is_one_line(
    make: Callable[[Path], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(tmp_path / "data")
    before = {path.name for path in tmp_path.iterdir()}
    words = ["--mapping", "blackbird", "--data", str(tmp_path / "lab")]
    assert main(["log", "import", str(tmp_path / "data"), *words]) == 1
    [line] = capsys.readouterr().err.strip().splitlines()
    assert "at most" in line or "not a complete" in line
    assert {path.name for path in tmp_path.iterdir()} == before


def test_a_table_longer_than_is_read_and_a_line_without_end_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flight.csv"
    path.write_text("t,x,y\n" + "1,2,3\n" * 400)
    table = TextTable(path)
    monkeypatch.setattr(tables, "MAX_VALUES", 1200)
    assert len(table.read("", ["t", "x", "y"])) == 400
    monkeypatch.setattr(tables, "MAX_VALUES", 1199)
    with pytest.raises(LogFormatError, match="at most 399 are imported"):
        table.read("", ["t", "x", "y"])
    path.write_text("1," * text_table.LONGEST_LINE)
    with pytest.raises(LogFormatError, match="no rows of numbers"):
        TextTable(path)


def topics_of(flight: ForeignFlight) -> dict[str, np.ndarray[tuple[int], np.dtype[np.void]]]:
    """Return what PX4 would have logged of a flight that began 5 s after its start."""
    flight = turned(flight, FRD, NED)
    stamps = np.round((flight.seconds - flight.seconds[0] + 5.0) * 1e6)
    count = len(stamps)
    imu = np.zeros(
        count, [("timestamp", "u8"), ("gyro_rad", "f4", 3), ("accelerometer_m_s2", "f4", 3)]
    )
    imu["gyro_rad"], imu["accelerometer_m_s2"] = flight.rate, flight.force
    attitude = np.zeros(count, [("timestamp", "u8"), ("q", "f4", 4)])
    attitude["q"] = flight.quaternion
    axes = ("x", "y", "z", "vx", "vy", "vz")
    place = np.zeros(count, [("timestamp", "u8"), *((name, "f4") for name in axes)])
    for k, name in enumerate(axes):
        place[name] = (flight.position if k < 3 else flight.velocity)[:, k % 3]
    battery = np.zeros(20, [("timestamp", "u8"), ("voltage_v", "f4")])
    battery["voltage_v"] = 15.5
    fix = np.zeros(2, [("timestamp", "u8"), ("time_utc_usec", "u8")])
    fix["time_utc_usec"] = [0, int(flight.seconds[0] * 1e6) + 1_000_000]
    for rows, at in ((imu, stamps), (attitude, stamps), (place, stamps), (battery, stamps[:20])):
        rows["timestamp"] = at
    fix["timestamp"] = [5_500_000, 6_000_000]
    return {
        "sensor_combined": imu,
        "vehicle_attitude": attitude[::4].copy(),
        "vehicle_local_position": place[::2].copy(),
        "battery_status": battery,
        "vehicle_gps_position": fix,
    }


def test_ulog_with_the_date_of_its_receiver_and_its_own_estimate(tmp_path: Path) -> None:
    path = write_ulog(tmp_path / "log.ulg", topics_of(FLIGHT), 5_000_000, ("[commander] Armed",))
    found = read_flight(path)
    assert found.truth is None
    assert found.estimate is not None
    assert abs(found.imu.stamps_ns[0] * 1e-9 - FLIGHT.seconds[0]) < 1e-3
    assert np.allclose(found.imu.specific_force_b, FLIGHT.force, atol=1e-5)
    states = found.estimate.states
    assert np.allclose(
        states["position_w"], FLIGHT.position[::2][: len(states["position_w"])], atol=1e-5
    )
    assert np.allclose(
        states["velocity_w"], FLIGHT.velocity[::2][: len(states["position_w"])], atol=1e-5
    )
    assert found.battery is not None
    assert np.allclose(found.battery[1], 15.5)
    assert [text for _, _, text in found.events] == ["[commander] Armed"]
    assert not any("does not fit" in note for note in found.notes)


def test_an_estimate_that_is_wrong_is_kept_and_told(tmp_path: Path) -> None:
    topics = topics_of(FLIGHT)
    topics["vehicle_local_position"]["x"] *= -1.0
    found = read_flight(write_ulog(tmp_path / "log.ulg", topics))
    assert found.estimate is not None
    assert any("does not fit" in note for note in found.notes)


def test_a_ulog_without_imu_or_cut_off_is_refused(tmp_path: Path) -> None:
    topics = topics_of(FLIGHT)
    path = write_ulog(tmp_path / "log.ulg", topics)
    path.write_bytes(path.read_bytes()[:100_003])
    with pytest.raises(LogFormatError, match="is incomplete"):
        read_flight(path)
    assert len(read_flight(path, torn=True).imu.stamps_ns) > 500
    del topics["sensor_combined"]
    with pytest.raises(LogFormatError, match="sensor_combined"):
        read_flight(write_ulog(path, topics))
    path.write_bytes(b"ULog\x01\x12\x35\x01")
    with pytest.raises(LogFormatError):
        read_flight(path)


def test_a_ulog_whose_logger_lost_time_and_logged_a_topic_again_is_read_whole(
    tmp_path: Path,
) -> None:
    topics = topics_of(FLIGHT)
    whole = topics.pop("sensor_combined")
    half = len(whole) // 2
    topics |= {"sensor_combined": whole[:half], "sensor_combined again": whole[half:]}
    found = read_flight(write_ulog(tmp_path / "log.ulg", topics, dropouts_ms=(30, 120)))
    assert len(found.imu.stamps_ns) == len(whole)
    assert any("lost 0.15 s in 2 drop-outs, the longest of 0.12 s" in one for one in found.notes)


def test_crazyflie_with_motion_capture_by_another_clock_and_in_another_world(
    tmp_path: Path,
) -> None:
    from scipy.spatial.transform import Rotation

    here = Rotation.from_euler("z", 0.7)
    own = here.apply(FLIGHT.position) + np.array([1.0, -2.0, 0.1])
    lost = slice(2500, 2560)
    own[lost, 0] += 2.0 * np.sin(np.linspace(0.0, 3.0 * np.pi, 60))
    us = np.round((FLIGHT.seconds - FLIGHT.seconds[0] + 40.0) * 1e6).astype(np.int64)
    log = write_crazyflie(
        tmp_path / "log00",
        "fixedFrequency",
        us,
        **{f"gyro_{k}": np.degrees(FLIGHT.rate[:, i]) for i, k in enumerate("xyz")},
        **{f"acc_{k}": FLIGHT.force[:, i] / 9.80665 for i, k in enumerate("xyz")},
        **{f"stateEstimate_{k}": own[:, i] for i, k in enumerate("xyz")},
    )
    fast = make_flight(step=0.004)
    stamps = 1011.0 * (fast.seconds - FLIGHT.seconds[0]) + 7000.0  # a clock that runs faster
    np.save(tmp_path / "mocap00.npy", np.column_stack([stamps, fast.position]))
    found = read_flight(log, truth=tmp_path / "mocap00.npy")
    assert found.truth is not None
    assert found.estimate is not None
    assert not found.truth.attitude_known
    late = found.truth.stamps_ns[0] - found.imu.stamps_ns[0]
    assert abs(late) < 1_000_000
    assert np.allclose(found.imu.angular_velocity_b, FLIGHT.rate, atol=1e-5)
    off = np.abs(found.estimate.states["position_w"] - FLIGHT.position).max(axis=1)
    off[lost] = 0.0
    assert off.max() < 2e-3
    at = (found.truth.stamps_ns - found.imu.stamps_ns[0]) * 1e-9
    assert np.abs(at - (fast.seconds - FLIGHT.seconds[0])).max() < 1e-3
    read = read_recording(NewRun(found, log).write(tmp_path, "run"))
    assert len(read.poses) > 1000
    assert not any(one.measurement["quaternion_wb"].any() for one in read.poses)
    [run] = plan_runs(read, (), ["error_state"], (), "poses")
    done = replay(read, run, read.poses)
    off = np.linalg.norm(done.states["position_w"] - FLIGHT.position, axis=1)[500:2300]
    assert np.sqrt((off**2).mean()) < 0.02
    assert read_flight(log).truth is None
    log.write_bytes(log.read_bytes()[:50_000])
    with pytest.raises(LogFormatError, match="is incomplete"):
        read_flight(log)
    assert len(read_flight(log, torn=True).imu.stamps_ns) > 1000


@pytest.mark.parametrize(("lively", "tilt"), [(True, 4.0), (True, 0.0), (False, 0.0)])
def test_worlds_are_tilted_against_each_other_only_if_the_motion_shows_it(
    lively: bool, tilt: float
) -> None:
    from scipy.spatial.transform import Rotation

    random = np.random.default_rng(3)
    own = FLIGHT.position * (1.0 if lively else np.array([0.01, 0.01, 1.0]))
    turn = Rotation.from_euler("ZX", [40.0, tilt], degrees=True)
    true = turn.apply(own) + random.normal(0.0, 0.01, own.shape)
    found = Rotation.from_matrix(world_turn(own, true))
    assert np.degrees((found * turn.inv()).magnitude()) < (1.0 if lively else 15.0)
    assert (found.as_matrix()[2, 2] == pytest.approx(1.0, abs=1e-12)) == (tilt == 0.0)


GEOMETRY = """
systemType: 2
geos:
  0: {origin: [-2.0, 1.0, 3.0], rotation: [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]}
  1: {origin: [1.5, -2.0, 3.0], rotation: [[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]]}
calibs:
  0: {sweeps: [&a {tilt: 0.01, phase: 0.02, gibmag: 0.004, gibphase: 1.0, curve: 0.3}, *a]}
  1: {sweeps: [*a, *a]}
"""


@pytest.mark.parametrize("crossing", [False, True])
def test_sweeps_of_a_crazyflie_are_stamped_by_their_pulses_and_replayed(
    tmp_path: Path, crossing: bool
) -> None:
    """Both planes of a station are in the log 2 to 13 ms after the second hit the deck; firmware
    that crosses beams writes those of the other one again.
    """
    place = tmp_path / "system-config.yaml"
    place.write_text(GEOMETRY)
    _, planes = read_stations(place)
    seconds = FLIGHT.seconds - FLIGHT.seconds[0]
    matrices = FLIGHT.rotation.as_matrix()
    angles, pulses = [], []
    for turn in range(1, 1200):
        for station in (0, 1):
            for sweep in (0, 1):
                at = 0.02 * turn + 0.007 * sweep + 0.004 * station
                pulses.append((at + 0.0003, station, 1e5 + 2e5 * sweep, 24e6 * (at + 3.0)))
                position = [np.interp(at, seconds, one) for one in FLIGHT.position.T]
                matrix = matrices[round(at * 100)]
                frame = np.zeros((), SWEEPS_SAMPLE)
                frame["plane"] = planes[2 * station + sweep]
                numbers = plane_numbers(frame)
                for k, sensor in enumerate(SENSORS_B):
                    x, y, z = position + matrix @ sensor
                    late = 0.02 * turn + 0.009 + 0.011 * station + 1e-5 * k
                    angles.append((late, station, sweep, k, swept(numbers, (x, y, z))[0]))
            if crossing:
                other = [one for one in angles[-16:-8] if one[1] != station]
                angles += [(angles[-1][0] + 1e-5, *one[1:]) for one in other]
    tables = {
        "lhAngle": (angles, ("basestation", "sweep", "sensor", "angle")),
        "lhUartFrame": (pulses, ("basestation", "offset", "timestamp2FPGA")),
    }
    events: dict[str, Event] = {
        "fixedFrequency": (
            np.round((seconds + 40.0) * 1e6).astype(np.int64),
            {
                **{f"gyro_{k}": np.degrees(FLIGHT.rate[:, i]) for i, k in enumerate("xyz")},
                **{f"acc_{k}": FLIGHT.force[:, i] / 9.80665 for i, k in enumerate("xyz")},
                **{f"stateEstimate_{k}": FLIGHT.position[:, i] for i, k in enumerate("xyz")},
            },
        )
    }
    for name, (rows, fields) in tables.items():
        table = np.array(rows)
        us = np.round((table[:, 0] + 40.0) * 1e6).astype(np.int64)
        events[name] = us, dict(zip(fields, table.T[1:], strict=True))
    log = write_events(tmp_path / "log00", events)
    found = read_flight(log)
    assert found.sweeps is not None
    after = (found.sweeps["stamp_ns"] - found.imu.stamps_ns[0]) * 1e-9 - 0.02
    met = 0.007 * (found.sweeps["number"] % 2) + 0.004 * (found.sweeps["number"] // 2)
    assert np.abs((after - met + 0.01) % 0.02 - 0.01).max() < 0.001
    assert 4 * 1190 < len(found.sweeps) <= 4 * 1200  # no angle twice
    read = read_recording(NewRun(found, log).write(tmp_path, "run"))
    assert [one.measurement[0] for one in read.sweeps[:9]] == list(found.sweeps[:9])
    [run] = plan_runs(read, (), ["error_state"], (), "sweeps")
    assert run.parameters.estimation.error_state.accelerometer_noise == 0.03  # by the mapping
    done = replay(read, run, read.sweeps)
    off = np.linalg.norm(done.states["position_w"] - FLIGHT.position, axis=1)[500:2300]
    assert np.sqrt((off**2).mean()) < 0.02
    assert np.mean(done.rejected) < 0.05
    with pytest.raises(UsageError, match="error_state"):
        plan_runs(read, (), ["complementary"], (), "sweeps")
    place.write_text("geos: 3")
    with pytest.raises(LogFormatError, match="base stations"):
        read_flight(log)
    place.unlink()
    assert read_flight(log).sweeps is None


@pytest.mark.parametrize(
    ("mapping", "body", "truth_folder", "truth_kinds"),
    [("euroc", "URF", "state_groundtruth_estimate0", "tpqv"), ("tum_vi", "FLU", "mocap0", "tpq")],
)
def test_euroc_and_tum_vi_as_their_folders_have_them(
    tmp_path: Path, mapping: str, body: str, truth_folder: str, truth_kinds: str
) -> None:
    flight = turned(FLIGHT, axes(body, "").T)
    columns = columns_of(flight)
    columns["t"] = columns["t"] * 1e9
    names = {
        "t": "#timestamp [ns]",
        **{f"g{k}": f"w_RS_S_{k} [rad s^-1]" for k in "xyz"},
        **{f"a{k}": f"a_RS_S_{k} [m s^-2]" for k in "xyz"},
        **{f"p{k}": f"p_RS_R_{k} [m]" for k in "xyz"},
        **{f"q{k}": f"q_RS_{k} []" for k in "wxyz"},
    }
    speeds = {f"v_RS_R_{k} [m s^-1]": flight.velocity[:, i] for i, k in enumerate("xyz")}
    for folder, kinds in (("imu0", "tga"), (truth_folder, truth_kinds)):
        (tmp_path / folder).mkdir()
        chosen = {names[name]: one for name, one in columns.items() if name[0] in kinds}
        write_csv(tmp_path / folder / "data.csv", chosen | (speeds if "v" in kinds else {}))
    is_the_flight(read_flight(tmp_path / "imu0" / "data.csv", mapping))


def test_the_csv_of_blackbox_decode(tmp_path: Path) -> None:
    columns = columns_of(FLIGHT)
    rows = {
        "loopIteration": np.arange(len(FLIGHT.seconds)),
        "time (us)": 1e6 * (columns["t"] - columns["t"][0]),
        **{f"gyroADC[{k}]": np.degrees(FLIGHT.rate[:, k]) for k in range(3)},
        **{f"accSmooth[{k}]": FLIGHT.force[:, k] / 9.80665 * 2048 for k in range(3)},
    }
    found = read_flight(write_csv(tmp_path / "log.01.csv", rows), "betaflight")
    assert np.allclose(found.imu.specific_force_b, FLIGHT.force, atol=1e-5)
    assert np.allclose(found.imu.angular_velocity_b, FLIGHT.rate, atol=1e-5)


@pytest.mark.parametrize("version", [1, 2])
def test_bags_of_ros_1_and_ros_2(tmp_path: Path, version: int) -> None:
    path = write_bag(tmp_path / ("flight.bag" if version == 1 else "flight"), FLIGHT, version)
    is_the_flight(read_flight(path))
    if version == 1:
        path.write_bytes(path.read_bytes()[:300_000])
        with pytest.raises(LogFormatError):
            read_flight(path)


def _pack(folder: Path, mode: str, size: int) -> None:
    """Mark a bag's parts as compressed, and put `size` highly compressible zeros into the first."""
    database = folder / f"{folder.name}.db3"
    zeros = ZstdCompressor().compressobj()
    packed = b"".join(zeros.compress(bytes(1_000_000)) for _ in range(size // 1_000_000))
    packed += zeros.flush()
    if mode == "message":
        with sqlite3.connect(database) as connection:
            connection.execute("UPDATE messages SET data = ? WHERE id = 1", (packed,))
        connection.close()
    else:
        database.write_bytes(packed)
    described = folder / "metadata.yaml"
    text = described.read_text().replace("compression_mode: ''", f"compression_mode: {mode}")
    described.write_text(text.replace("compression_format: ''", "compression_format: zstd"))


@pytest.mark.parametrize("mode", ["message", "file"])
def test_a_small_bag_that_opens_to_gigabytes_is_one_line(
    mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_bag(tmp_path / "flight", FLIGHT, 2)
    _pack(bag, mode, 1_500_000_000 if mode == "message" else 30_000_000)
    monkeypatch.setattr(limits, "MAX_UNPACKED", 20_000_000)
    before = [resource.getrlimit(one) for one in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)]
    assert main(["log", "import", str(bag), "--data", str(tmp_path / "lab")]) == 1
    [line] = capsys.readouterr().err.strip().splitlines()
    assert ("needs more than 400 MB" if mode == "message" else "File too large") in line
    after = [resource.getrlimit(one) for one in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE)]
    assert after == before
    assert not list((tmp_path / "lab").glob("runs/*"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[imu]\nbodi = 1", "bodi"),
        ("[imu]\ntime = 't'", "missing"),
        ("[imu", "cannot be read"),
        ("[imu]\nangular_velocity = 'g'\nspecific_force = 'a'\n", "time or rate"),
        (
            "[imu]\ntime = 't'\nangular_velocity = 'g'\nspecific_force = 'a'\n"
            "specific_force_unit = 'ounces'",
            "specific_force_unit",
        ),
    ],
)
def test_a_wrong_mapping_says_where(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "m.toml"
    path.write_text(text)
    with pytest.raises(UsageError) as refused:
        load_mapping(str(path))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_every_mapping_that_comes_with_quadlab_is_one() -> None:
    assert "blackbird" in names()
    assert all(load_mapping(name).imu for name in names())


def test_a_run_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    found = imported(tmp_path, columns_of(FLIGHT))
    runs = tmp_path / "data" / "runs"
    runs.mkdir(parents=True)
    run = NewRun(found, Path("flight.csv")).write(runs, "one")
    sound = check.check_log(run)
    assert not sound.problems
    recording = read_recording(run)
    assert not recording.parameters_recorded
    assert np.allclose(recording.imu["specific_force_b"], FLIGHT.force, atol=1e-6)
    assert found.truth is not None
    assert np.allclose(recording.truth["velocity_w"], found.truth.states["velocity_w"])
    assert len(recording.poses) == len(FLIGHT.seconds)
    with pytest.raises(StorageError):
        NewRun(found, Path("flight.csv")).write(runs, "one")
    assert [path.name for path in (tmp_path / "data").iterdir()] == ["runs"]


def test_the_command_imports_into_the_catalogue_and_refuses_without_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_csv(tmp_path / "flight.csv", columns_of(FLIGHT))
    mapping = write_mapping(tmp_path / "mapping.toml")
    data = tmp_path / "data"
    words = ["log", "import", str(path), "--data", str(data)]
    assert main([*words, "--mapping", str(mapping)]) == 0
    run = Path(capsys.readouterr().out.splitlines()[-1])
    assert run.parent == data / "runs"
    assert run.name == "20231114T221320Z_foreign"
    assert main(words) == 2
    assert main([*words, "--mapping", str(write_mapping(mapping, 'body = "FRD"'))]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 2
    assert list(run.parent.glob("[!.]*")) == [run]
