"""Betaflight's own logs: frames byte by byte, several logs, damages, and whole flights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extensions.importers.importing import read_flight
from extensions.importers.readers.blackbox import BlackboxTables
from extensions.importers.tests.blackbox_writer import (
    END,
    FLIGHT,
    flight_log,
    header,
    signed,
    unsigned,
)
from extensions.importers.tests.foreign_flight import make_flight
from quadlab.__main__ import main
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

G = 9.80665


def rows_of_flight(count: int = 3000) -> list[list[int]]:
    """Return a flight as counts: 1 deg/s and 1/2048 g, at 100 Hz from 50 s on."""
    flight = make_flight()
    rate = np.rint(np.degrees(flight.rate)).astype(int)
    force = np.rint(2048 / G * flight.force).astype(int)
    return [
        [k, 50_000_000 + 10_000 * k, *rate[k].tolist(), *force[k].tolist()] for k in range(count)
    ]


ROWS = rows_of_flight()


def opened(folder: Path, data: bytes, *tables: str) -> BlackboxTables:
    path = folder / "flight.bbl"
    path.write_bytes(data)
    return BlackboxTables(path, tables or ("",))


def numbers(source: BlackboxTables, table: str = "") -> Array:
    """Return all columns as the log has them: deg/s, and counts of the accelerometer."""
    found = source.read(table, FLIGHT)
    found[:, 5:] *= 2048
    return found


@pytest.mark.parametrize(
    ("encoding", "data", "values"),
    [
        pytest.param(0, "03", [-2], id="signed"),
        pytest.param(0, "8001", [64], id="signed of two bytes"),
        pytest.param(0, "ffffffff0f", [-(2**31)], id="smallest"),
        pytest.param(1, "ac02", [300], id="unsigned"),
        pytest.param(3, "05", [-5], id="negative 14 bit"),
        pytest.param(3, "ff7f", [1], id="negative 14 bit, extended"),
        pytest.param(6, "050203", [1, 0, -2], id="eight, of three"),
        pytest.param(6, "02", [1], id="eight, of one: without a first byte"),
        pytest.param(7, "1b", [1, -2, -1], id="three of 2 bits"),
        pytest.param(7, "478f", [7, -8, -1], id="three of 4 bits"),
        pytest.param(7, "9f203f", [31, -32, -1], id="three of 6 bits"),
        pytest.param(7, "f480008001000080", [-128, -32768, 1 - 2**31], id="three sizes"),
        pytest.param(7, "c20000800102", [-(2**23), 1, 2], id="24 bits"),
        pytest.param(8, "c97fe12340", [7, -2, 0, 0x1234], id="four"),
        pytest.param(9, "", [0], id="nothing"),
        pytest.param(10, "5f08", [15, -16, -8], id="three of 5, 5 and 4 bits"),
        pytest.param(10, "9fe07f", [127, -64, -1], id="three of 8, 7 and 7 bits"),
    ],
)
def test_each_encoding_byte_by_byte(
    tmp_path: Path, encoding: int, data: str, values: list[int]
) -> None:
    names = [f"f{k}" for k in range(len(values))]
    head = header(
        ["loopIteration", "time", *names], [(0, 1), (0, 1), *[(0, encoding)] * len(values)]
    )
    frame = b"I" + unsigned(0) + unsigned(100) + bytes.fromhex(data)
    log = opened(tmp_path, head + frame + END)
    assert log.read("", ["time", *names]).tolist() == [[100, *values]]
    assert log.notes == []


def test_four_numbers_of_data_version_1(tmp_path: Path) -> None:
    names = ["a", "b", "c", "d"]
    lines: dict[str, Any] = {"Data version": 1}
    head = header(["loopIteration", "time", *names], [(0, 1), (0, 1), *[(0, 8)] * 4], **lines)
    log = opened(tmp_path, head + b"I\0\x64" + bytes.fromhex("e5f7803412") + END)
    assert log.read("", names).tolist() == [[7, -1, -128, 0x1234]]


def test_each_predictor(tmp_path: Path) -> None:
    names = ["a", "b", "c", "d", "e", "u", "motor[0]", "motor[1]"]
    intra = [(0, 1), (0, 1), *[(one, 0) for one in (0, 0, 0, 4, 9, 8, 11, 5)]]
    inter = [(6, 9), (2, 0), *[(one, 0) for one in (1, 2, 3, 1, 1, 3, 3, 3)]]
    lines: dict[str, Any] = {
        "P interval": "1/2",
        "minthrottle": 1070,
        "vbatref": 163,
        "motorOutput": "88,2047",
    }
    frames = [
        b"I" + unsigned(0) + unsigned(1000),
        *map(signed, (10, 10, -6, 5, -3, 1, 12, -4)),
        *(b"P", *map(signed, (500, 2, 2, 3, 0, 0, 1, 0, 0))),
        *(b"P", *map(signed, (0, 0, 0, 0, 0, 0, 0, 0, 0))),
    ]
    head = header(["loopIteration", "time", *names], intra, inter, **lines)
    log = opened(tmp_path, head + b"".join(frames) + END)
    assert log.read("", ["loopIteration", "time", *names]).tolist() == [
        [0, 1000, 10, 10, -6, 1075, 160, 1501, 100, 96],
        [2, 1500, 12, 12, -3, 1075, 160, 1502, 100, 96],
        [4, 2000, 12, 14, -4, 1075, 160, 1501, 100, 96],  # -9 / 2 is -4 there, 3003 / 2 1501
    ]


def test_slow_and_gps_frames_and_events_are_passed_over(tmp_path: Path) -> None:
    lines: dict[str, Any] = {
        "Field S encoding": "1,1,7,7,7",
        "Field G encoding": "1,0",
        "Field H encoding": "0",
    }
    between = b"S\x01\x02\x1bG\x05\x06H\x07E\x00\x09E\x1e\x01\x02E\x0f\x03"
    whole = flight_log(ROWS[:64], **lines)
    at = len(flight_log(ROWS[:1], **lines)) - len(END)
    log = opened(tmp_path, whole[:at] + between + whole[at:])
    assert numbers(log).tolist() == [list(map(float, row)) for row in ROWS[:64]]
    assert log.notes == []


@pytest.mark.parametrize("size", [1, 7, 300])
def test_what_is_left_of_a_damaged_log_is_as_it_was(tmp_path: Path, size: int) -> None:
    whole = flight_log(ROWS)
    at = whole.index(b"I", len(whole) // 2) + 20
    log = opened(tmp_path, whole[:at] + whole[at + size :])
    found = numbers(log)
    assert len(ROWS) - 33 - size // 8 < len(found) < len(ROWS)
    assert (found == np.array(ROWS, float)[found[:, 0].astype(int)]).all()
    assert any("damaged in 1 places" in note for note in log.notes)


def test_a_log_that_is_cut_off(tmp_path: Path) -> None:
    whole = flight_log(ROWS)
    path = tmp_path / "flight.bbl"
    path.write_bytes(whole[: len(whole) // 2])
    if whole[len(whole) // 2] in b"IPE":  # not between two frames
        path.write_bytes(whole[: len(whole) // 2 + 2])
    with pytest.raises(LogFormatError, match="within a frame"):
        read_flight(path)
    assert 1000 < len(read_flight(path, torn=True).imu.stamps_ns) < 2000


def test_a_flight_is_what_it_was(tmp_path: Path) -> None:
    path = tmp_path / "flight.bfl"
    lines: dict[str, Any] = {"Log start datetime": "2024-05-06T07:08:09.000+00:00"}
    path.write_bytes(flight_log(ROWS, **lines))
    found, flight = read_flight(path), make_flight()
    assert np.abs(found.imu.angular_velocity_b - flight.rate).max() < np.radians(0.51)
    assert np.abs(found.imu.specific_force_b - flight.force).max() < 0.51 * G / 2048
    assert found.imu.stamps_ns[0] == 1_714_979_289_000_000_000
    assert (np.diff(found.imu.stamps_ns) == 10_000_000).all()
    path.write_bytes(flight_log(ROWS, blackbox_high_resolution=1))
    finer = read_flight(path).imu.angular_velocity_b
    assert np.allclose(10.0 * finer, found.imu.angular_velocity_b)


def test_one_of_several_logs_is_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.bbl"
    path.write_bytes(flight_log(ROWS[:40]) + flight_log(ROWS) + flight_log(ROWS[:90]))
    command = ["log", "import", str(path), "--data", str(tmp_path / "lab")]
    assert main(command) == 1
    told = capsys.readouterr().err
    assert "log 1 has 40 frames" in told
    assert "--table NUMBER" in told
    assert main([*command, "--table", "2"]) == 0
    told = capsys.readouterr().out
    assert "3000 IMU samples" in told
    assert "3 logs, one for each arming" in told
    assert "imported is 2" in told
    assert main([*command, "--table", "7"]) == 1
    assert "there is no table '7'; there are 1, 2, 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("data", "words"),
    [
        pytest.param(flight_log(ROWS, acc_1G=0), "acc_1G in its header is 0", id="0"),
        pytest.param(flight_log(ROWS, acc_1G=None), "acc_1G in its header is 0", id="none"),
        pytest.param(
            flight_log(ROWS).replace(b"accSmooth", b"accUnused"), "accSmooth are missing", id="off"
        ),
        pytest.param(
            flight_log([[*row[:5], 0, 0, 0] for row in ROWS]), "its values are all 0", id="zeros"
        ),
    ],
)
def test_a_log_without_an_accelerometer_says_so(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "flight.bbl"
    path.write_bytes(data)
    with pytest.raises(LogFormatError, match="has no accelerometer") as refused:
        read_flight(path)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_log_without_frames_is_not_said_to_lack_an_accelerometer(tmp_path: Path) -> None:
    path = tmp_path / "flight.bbl"
    path.write_bytes(flight_log([]))
    with pytest.raises(LogFormatError, match="0 rows; at least 50 are needed"):
        read_flight(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"Field P encoding:9,0", b"Field P encoding:9,4", "encoding 4 is not known"),
        (b"Field P predictor:6,2", b"Field P predictor:6,99", "predictor 99 is not known"),
        (b"Field I signed:0,", b"Field I signed:", "cannot be read"),
        (b"I interval:32", b"I interval:0", "intervals"),
        (b"Field I encoding:1,1,0", b"Field I encoding:1,1,8", "group"),
        (b"Field I predictor:0,0,0", b"Field I predictor:0,0,5", "motor"),
        (b"acc_1G:2048", b"acc_1G:many", "cannot be read"),
    ],
)
def test_a_header_that_cannot_be_is_refused_in_a_line(
    tmp_path: Path, old: bytes, new: bytes, words: str
) -> None:
    data = flight_log(ROWS[:64])
    assert old in data
    with pytest.raises(LogFormatError, match=words) as refused:
        opened(tmp_path, data.replace(old, new, 1))
    assert "\n" not in str(refused.value)


def test_noise_is_read_without_an_error(tmp_path: Path) -> None:
    whole = flight_log(ROWS[:64])
    head = whole[: whole.index(b"I", whole.index(b"acc_1G") + 12)]
    noise = np.random.default_rng(3).bytes(20_000)
    for body in (noise, b"", b"I" * 5000, b"E" * 5000):
        log = opened(tmp_path, head + body)
        assert log.columns("")[:2] == FLIGHT[:2]


def test_logs_are_found_across_the_pieces_that_are_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = flight_log(ROWS[:100])
    monkeypatch.setattr("extensions.importers.readers.blackbox.PIECE", len(one) + 7)
    tables = opened(tmp_path, 3 * one, "3")
    assert tables.flights == ["1", "2", "3"]
    assert len(tables.read("3", ["time"])) == 100


def test_a_log_is_decoded_in_pieces_as_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = flight_log(ROWS[:500])
    damaged = whole[: len(whole) // 2] + whole[len(whole) // 2 + 9 :]
    for number, data in enumerate((whole, damaged, whole[:-40])):
        (tmp_path / str(number)).mkdir()
        log = opened(tmp_path / str(number), data)
        at_once, notes, torn = numbers(log), log.notes, log.torn
        with monkeypatch.context() as small:
            small.setattr("extensions.importers.readers.blackbox.PIECE", 600)
            small.setattr("extensions.importers.readers.blackbox.LONGEST_FRAME", 200)
            log = opened(tmp_path / str(number), data)
            assert numbers(log).tolist() == at_once.tolist()
            assert (log.notes, log.torn) == (notes, torn)


def test_a_log_of_more_frames_than_memory_is_for_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("extensions.importers.readers.blackbox.MOST_FRAMES", 100)
    assert len(numbers(opened(tmp_path, flight_log(ROWS[:100])))) == 100
    with pytest.raises(LogFormatError, match="log 1 has more than 100 frames"):
        numbers(opened(tmp_path, flight_log(ROWS[:101])))


def test_the_end_of_one_of_several_parts_is_missed(tmp_path: Path) -> None:
    for name, rows in (("a", ROWS[:100]), ("b", ROWS[128:300])):
        (tmp_path / f"{name}.bbl").write_bytes(flight_log(rows)[:-30])
    with pytest.raises(LogFormatError, match=r"a\.bbl: it ends within a frame"):
        read_flight(tmp_path / "a.bbl", more=[tmp_path / "b.bbl"])
