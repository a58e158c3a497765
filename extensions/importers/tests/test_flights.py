"""Several flights in one file, one flight in several files, and mappings that are proposed."""

from __future__ import annotations

import gzip
import os
import shutil
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.importers import importing, run_writer
from extensions.importers.flight import ImportedFlight
from extensions.importers.importing import READ, flights_of, read_flight
from extensions.importers.proposal import propose
from extensions.importers.readers.progress import each, tell, told
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.foreign_flight import (
    EPOCH,
    ForeignFlight,
    columns_of,
    make_flight,
    write_csv,
    write_mapping,
)
from quadlab.__main__ import main
from quadlab.interrupt import INTERRUPTED
from quadrotor.errors import LogFormatError, UsageError
from quadrotor.records import Array

FLIGHT = make_flight(seconds=6.0)
COLUMNS = columns_of(FLIGHT)
UNITS = {"imu": 'angular_velocity_unit = "rad/s"\nspecific_force_unit = "m/s^2"\nbody = "FLU"'}
IMU = ["t", "gx", "gy", "gz", "ax", "ay", "az"]


def imu_mapping(folder: Path) -> str:
    text = write_mapping(folder / "imu.toml", **UNITS).read_text()
    (folder / "imu.toml").write_text(text.partition("[truth]")[0])
    return str(folder / "imu.toml")


def rows(begin: int, end: int, later: float = 0.0) -> dict[str, Array]:
    """Return rows of the flight's IMU with stamps that are `later` seconds late."""
    found = {name: COLUMNS[name][begin:end].copy() for name in IMU}
    found["t"] += later - COLUMNS["t"][0]
    return found


def put_together(*parts: dict[str, Array]) -> dict[str, Array]:
    return {name: np.concatenate([one[name] for one in parts]) for name in parts[0]}


def test_two_flights_in_one_file_are_named_and_each_is_imported(tmp_path: Path) -> None:
    both = put_together(rows(0, 200), rows(300, 600, later=-3.0))
    path, mapping = write_csv(tmp_path / "two.csv", both), imu_mapping(tmp_path)
    with pytest.raises(LogFormatError, match=r"has 2 flights \(1: 200 rows, 2.0 s; 2: 300 rows"):
        read_flight(path, mapping)
    assert flights_of(path, mapping) == 2
    first, second = (read_flight(path, mapping, flight=k) for k in (1, 2))
    assert np.allclose(first.imu.angular_velocity_b, FLIGHT.rate[:200], atol=1e-8)
    assert np.allclose(second.imu.angular_velocity_b, FLIGHT.rate[300:], atol=1e-8)
    with pytest.raises(LogFormatError, match="no flight 3: there are 2"):
        read_flight(path, mapping, flight=3)


def test_a_gap_of_a_minute_is_named_and_its_sides_can_be_runs(tmp_path: Path) -> None:
    both = put_together(rows(0, 200), rows(200, 600, later=100.0))
    path, mapping = write_csv(tmp_path / "gap.csv", both), imu_mapping(tmp_path)
    whole = read_flight(path, mapping)
    assert len(whole.imu.stamps_ns) == 600
    assert any("a gap of 100.0 s; --flight all imports the parts" in one for one in whole.notes)
    assert len(read_flight(path, mapping, flight=2).imu.stamps_ns) == 400


def test_flights_without_a_date_follow_one_another(tmp_path: Path) -> None:
    parts = rows(0, 200), rows(200, 400, later=100.0), rows(400, 600, later=-4.0)
    path = write_csv(tmp_path / "three.csv", put_together(*parts))
    mapping, wrote_ns = imu_mapping(tmp_path), 1_700_000_000_000_000_000
    os.utime(path, ns=(wrote_ns, wrote_ns))
    found = [read_flight(path, mapping, flight=k).imu.stamps_ns for k in (1, 2, 3)]
    assert abs(found[2][-1] - wrote_ns) < 1000
    assert abs(found[1][-1] - found[2][0]) < 1000
    assert abs(found[1][0] - found[0][-1] - 100_010_000_000) < 1000


def test_stamps_that_go_back_for_a_moment_are_no_second_flight(tmp_path: Path) -> None:
    columns = rows(0, 600)
    columns["t"][[300, 301]] = columns["t"][[301, 300]]
    path = write_csv(tmp_path / "order.csv", columns)
    found = read_flight(path, imu_mapping(tmp_path))
    assert len(found.imu.stamps_ns) == 599
    assert any("away from those around them" in one and "row 302" in one for one in found.notes)


def test_a_track_of_the_same_rows_is_cut_as_its_imu_is(tmp_path: Path) -> None:
    later = {name: values.copy() for name, values in COLUMNS.items()}
    path = write_csv(tmp_path / "two.csv", put_together(COLUMNS, later))
    mapping = write_mapping(tmp_path / "both.toml", **UNITS)
    second = read_flight(path, str(mapping), flight=2)
    assert second.truth is not None
    assert np.allclose(second.truth.states["position_w"], FLIGHT.position, atol=1e-6)


def test_files_of_one_flight_are_joined_in_the_order_of_their_times(tmp_path: Path) -> None:
    first = write_csv(tmp_path / "log10.csv", rows(0, 250))
    second = write_csv(tmp_path / "log9.csv", rows(400, 600))
    mapping = imu_mapping(tmp_path)
    found = read_flight(second, mapping, more=[first])
    kept = np.r_[0:250, 400:600]
    assert np.allclose(found.imu.specific_force_b, FLIGHT.force[kept], atol=1e-8)
    assert any("between log10.csv and log9.csv 1.5" in note for note in found.notes)
    with pytest.raises(LogFormatError, match="are not parts of one flight"):
        read_flight(first, mapping, more=[first])


def test_each_flight_of_a_file_becomes_a_run_and_what_cannot_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still = rows(300, 600, later=-3.0)
    for name in ("ax", "ay", "az"):
        still[name] *= 0.0
    path = write_csv(tmp_path / "two.csv", put_together(rows(0, 200), still))
    words = ["log", "import", str(path), "--mapping", imu_mapping(tmp_path), "--data"]
    assert main([*words, str(tmp_path / "data"), "--flight", "all"]) == 0
    out, err = capsys.readouterr()
    assert "1 of 2 flights are imported" in out
    assert "flight 2 is not imported: [imu] specific_force has a median length of 0" in err
    assert len(list((tmp_path / "data" / "runs").glob("2*"))) == 1
    assert main([*words, str(tmp_path / "data"), "--flight", "0"]) == 2
    assert "--flight 0: a number from 1, or all, is needed" in capsys.readouterr().err


def test_one_database_of_a_bag_is_read_without_its_folder(tmp_path: Path) -> None:
    [file] = write_bag(tmp_path / "bag", FLIGHT, 2).glob("*.db3")
    found = read_flight(Path(shutil.move(file, tmp_path / "alone.db3")))
    assert np.allclose(found.imu.specific_force_b, FLIGHT.force, atol=1e-9)


def test_a_bag_of_several_mcap_files_is_one_flight(tmp_path: Path) -> None:
    first, last = (
        ForeignFlight(**{one.name: getattr(FLIGHT, one.name)[rows] for one in fields(FLIGHT)})
        for rows in (slice(0, 350), slice(350, 600))
    )
    bag = write_bag(tmp_path / "bag", last, 2, mcap=True)
    [second] = write_bag(tmp_path / "second", first, 2, mcap=True).glob("*.mcap")
    shutil.move(second, bag / "bag_1.mcap")
    found = read_flight(bag)
    assert found.truth is not None
    assert len(found.imu.stamps_ns) == len(found.truth.stamps_ns) == 600
    assert np.allclose(found.imu.specific_force_b, FLIGHT.force, atol=1e-9)


AXES = "XYZ"


def strange_columns() -> dict[str, Array]:
    """Return a flight under names that no mapping of quadlab has: µs, deg/s, mg and mm."""
    found = {"Timestamp": np.round(1e6 * (FLIGHT.seconds - FLIGHT.seconds[0]))}
    found |= {f"Gyro{a}_dps": np.degrees(FLIGHT.rate[:, k]) for k, a in enumerate(AXES)}
    found |= {f"AccRaw{a}": 1000.0 / 9.80665 * FLIGHT.force[:, k] for k, a in enumerate(AXES)}
    found |= {f"opti_pos[{k}]": 1000.0 * FLIGHT.position[:, k] for k in range(3)}
    found |= {f"att[{k}]": FLIGHT.quaternion[:, [1, 2, 3, 0]][:, k] for k in range(4)}
    found |= {"vbat": np.full(len(FLIGHT.seconds), 14.8), "motor": FLIGHT.seconds * 0.0}
    return found


def test_a_proposed_mapping_names_every_column_of_a_strange_table(tmp_path: Path) -> None:
    path, target = write_csv(tmp_path / "s.csv", strange_columns()), tmp_path / "s.toml"
    lines = propose(path, target)
    found = tomllib.loads(target.read_text())
    assert found["imu"] == {
        "time": "Timestamp",
        "time_unit": "us",
        "angular_velocity": [f"Gyro{a}_dps" for a in AXES],
        "angular_velocity_unit": "deg/s",
        "specific_force": [f"AccRaw{a}" for a in AXES],
        "specific_force_unit": "mg",
    }
    assert found["truth"]["position"] == [f"opti_pos[{k}]" for k in range(3)]
    assert found["truth"]["quaternion"] == [f"att[{k}]" for k in range(4)]
    assert found["battery"]["voltage"] == "vbat"
    assert any("100 Hz by Timestamp in us" in line for line in lines)
    flight = read_flight(path, str(target))
    assert flight.truth is not None
    assert np.allclose(flight.imu.specific_force_b, FLIGHT.force, atol=1e-6)
    assert np.allclose(flight.truth.states["position_w"], FLIGHT.position, atol=1e-4)
    with pytest.raises(UsageError, match="is there already"):
        propose(path, target)


def test_a_table_without_an_imu_gets_no_proposal_but_what_it_has(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "x.csv", {"n": np.arange(60.0), "level": np.ones(60)})
    with pytest.raises(LogFormatError, match=r"it has a table \(60 rows at .* Hz: n, level\)"):
        propose(path, tmp_path / "x.toml")
    assert not (tmp_path / "x.toml").exists()


def test_flights_that_were_imported_are_kept_when_the_command_is_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    three = {name: np.tile(COLUMNS[name], 3) for name in IMU}
    three["t"] = np.concatenate([FLIGHT.seconds + 100.0 * k for k in range(3)])
    words = ["log", "import", str(write_csv(tmp_path / "f.csv", three))]
    words += ["--mapping", imu_mapping(tmp_path), "--flight", "all", "--data", str(tmp_path / "d")]
    write = run_writer.write_run

    def interrupted(path: Path, flight: ImportedFlight, *more: Any) -> None:
        if flight.imu.stamps_ns[0] > 1e9 * (EPOCH + 50.0):
            raise KeyboardInterrupt
        write(path, flight, *more)

    monkeypatch.setattr(importing, "write_run", interrupted)
    assert main(words) == INTERRUPTED
    assert "interrupted; imported 1 of" in capsys.readouterr().err
    assert len(list((tmp_path / "d/runs").glob("2*"))) == 1
    assert not list((tmp_path / "d").glob(".import-*"))
    monkeypatch.undo()
    assert main(words) == 0
    assert "flight 1 is imported already" in capsys.readouterr().out
    assert len(list((tmp_path / "d/runs").glob("2*"))) == 3


def test_angles_by_their_names_are_proposed(tmp_path: Path) -> None:
    angles = np.degrees(FLIGHT.rotation.as_euler("ZYX"))
    columns = {name: COLUMNS[name] for name in [*IMU, "px", "py", "pz"]}
    columns |= {f"est_{one}": angles[:, k] for k, one in enumerate(("yaw", "pitch", "roll"))}
    columns["roll_rate"] = COLUMNS["gx"]
    path = write_csv(tmp_path / "f.csv", columns)
    propose(path, tmp_path / "mapping.toml")
    truth = tomllib.loads((tmp_path / "mapping.toml").read_text())["truth"]
    assert truth["euler"] == ["est_yaw", "est_pitch", "est_roll"]
    assert (truth["euler_order"], truth["euler_unit"]) == ("ZYX", "deg")
    found = read_flight(path, str(tmp_path / "mapping.toml")).truth
    assert found is not None
    error = found.states["quaternion_wb"] - FLIGHT.quaternion[: len(found.stamps_ns)]
    assert np.abs(error).max() < 0.02


def test_a_gap_of_the_truth_contradicts_nothing(tmp_path: Path) -> None:
    flight = make_flight(seconds=24.0)
    columns = columns_of(flight)
    seen = np.abs(flight.seconds - flight.seconds[0] - 11.0) > 6.0
    truth = {name: one[seen] for name, one in columns.items() if name not in IMU[1:]}
    write_csv(tmp_path / "truth.csv", truth)
    path = write_csv(tmp_path / "f.csv", {name: columns[name] for name in IMU})
    mapping = write_mapping(tmp_path / "mapping.toml", truth='file = "truth.csv"')
    found = read_flight(path, str(mapping))
    assert found.truth is not None
    assert len(found.truth.stamps_ns) == seen.sum()


def test_a_row_that_is_minutes_away_from_all_others_is_left_out_of_all_tables(
    tmp_path: Path,
) -> None:
    columns = {name: one.copy() for name, one in COLUMNS.items()}
    columns["t"] += 300.0 - columns["t"][0]
    columns["t"][0] = 0.0
    mapping = str(write_mapping(tmp_path / "mapping.toml", 'angular_velocity_unit = "rad/s"'))
    found = read_flight(write_csv(tmp_path / "f.csv", columns), mapping)
    assert found.truth is not None
    for stamps in (found.imu.stamps_ns, found.truth.stamps_ns):
        assert len(stamps) == len(columns["t"]) - 1
        assert np.diff(stamps).max() < 20e6
    assert any("1 rows left out that are 60 s or more away" in one for one in found.notes)


def test_reading_tells_how_far_it_is_up_to_the_end(tmp_path: Path) -> None:
    [file] = write_bag(tmp_path / "bag", FLIGHT, 2, mcap=True).glob("*.mcap")
    packed = tmp_path / "f.mcap.gz"
    packed.write_bytes(gzip.compress(file.read_bytes()))
    for path in (file, packed):
        shares: list[float] = []
        read_flight(path, progress=shares.append)
        assert shares == sorted(shares)
        assert any(0.0 < one < READ for one in shares) == (path is packed)
        assert READ in shares
        assert shares[-1] == 1.0
    halves: list[float] = []
    with told(halves.append):
        for _ in each(["one", "two"]):
            tell(0.5)
    assert halves == [0.25, 0.75]


def test_an_interruption_while_it_reads_leaves_nothing_and_says_what_a_repetition_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(importing, "read_raw", interrupted)
    words = ["log", "import", str(write_csv(tmp_path / "f.csv", COLUMNS))]
    assert main([*words, "--mapping", imu_mapping(tmp_path), "--data", str(tmp_path / "d")]) == (
        INTERRUPTED
    )
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "imported none and left nothing behind; the same command begins anew" in error
    assert not (tmp_path / "d").exists()
