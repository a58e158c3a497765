"""Files as unlucky people hand them over: each is read with its numbers, or refused with why."""

from __future__ import annotations

import gzip
import json
import os
from collections.abc import Callable, Iterable
from decimal import Decimal
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from pyarrow import parquet
from scipy.io import savemat

from extensions.importers.exported import is_exported
from extensions.importers.files import Files
from extensions.importers.importing import read_flight
from extensions.importers.mapping import Mapping
from extensions.importers.readers.cells import Cells, remainder
from extensions.importers.readers.formats import format_of, open_source
from extensions.importers.readers.mcap_tables import McapTables
from extensions.importers.readers.parquet import ParquetTable
from extensions.importers.readers.plain_columns import PlainColumns
from extensions.importers.readers.tables import NumpyTable
from extensions.importers.readers.text_table import TextTable
from extensions.importers.stamps import continued, without_strays
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.foreign_flight import make_flight
from flight_log import limits
from quadlab.__main__ import main
from quadrotor.errors import LogFormatError
from quadrotor.records import Array, Stamps

COUNT = 60
EPOCH_NS = 1_403_636_579_763_555_584
STAMPS_NS: Stamps = EPOCH_NS + 5_000_000 * np.arange(COUNT) + np.arange(COUNT) % 3
NAMES = ["t", "wx", "wy", "wz", "ax", "ay", "az"]
FLIGHT = make_flight(seconds=0.6)


def samples() -> Array:
    """Return samples of an IMU at rest, (COUNT, 6): rad/s and m/s^2, with four decimals."""
    random = np.random.default_rng(7)
    mean, noise = [0, 0.2, 0, 0, 0, 9.8], [0.01] * 3 + [0.05] * 3
    return random.normal(mean, noise, (COUNT, 6)).round(4)


ROWS = samples()


def lines_of(
    stamps: Iterable[object], header: str = ",".join(NAMES), more: str = "", before: str = ""
) -> str:
    """Return a table with a header, and `more` behind and `before` before each row."""
    rows = [
        before + ",".join([str(t), *(f"{x:.4f}" for x in row)]) + more
        for t, row in zip(stamps, ROWS, strict=True)
    ]
    return "\n".join([header, *rows]) + "\n"


PLAIN = lines_of(f"{0.005 * k:.4f}" for k in range(COUNT))
LINES = PLAIN.splitlines()
SEMICOLONS = PLAIN.replace(",", ";").replace(".", ",")


def mapping(unit: str = "s", **imu: object) -> Mapping:
    rows = {
        "time": "t",
        "time_unit": unit,
        "angular_velocity": ["wx", "wy", "wz"],
        "angular_velocity_unit": "rad/s",
        "specific_force": ["ax", "ay", "az"],
        "specific_force_unit": "m/s^2",
    }
    return Mapping.model_validate({"imu": {**rows, **imu}})


def read(path: Path, unit: str = "s") -> tuple[Stamps, Array, list[str]]:
    """Return stamps in ns, angular velocities, and notes of a file's IMU."""
    told = mapping(unit)
    with Files([path], told, torn=False) as files:
        rows = told.imu
        columns = {
            "angular_velocity": (rows.angular_velocity, 3),
            "specific_force": (rows.specific_force, 3),
        }
        seconds, rate, _ = files.read(rows, "imu", columns)
        stamps = files.base_ns + np.round(1e9 * seconds).astype(np.int64)
        return stamps, rate, files.notes


def written(folder: Path, text: str | bytes, name: str = "flight.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    ("text", "first"),
    [
        pytest.param(PLAIN.replace("t,", '"time\nof sample",', 1), "time\nof sample", id="line"),
        pytest.param(PLAIN.replace("t,", '"a ""t"", s",', 1), 'a "t", s', id="quotes"),
        pytest.param(("\ufeff" + PLAIN).encode("utf-16-be"), "t", id="UTF-16, big-endian"),
        pytest.param(PLAIN.encode("utf-32"), "t", id="UTF-32"),
        pytest.param(PLAIN.replace(",", "|"), "t", id="bars"),
        pytest.param('"' + PLAIN.replace(",", '","').replace("\n", '"\n"')[:-1], "t", id="quoted"),
        pytest.param(
            ('"' + PLAIN.replace(",", '","').replace("\n", '"\n"')[:-1]).replace(".", ","),
            "t",
            id="decimal commas in quotation marks",
        ),
        pytest.param(PLAIN.replace("az\n", "az,\n", 1), "t", id="a comma behind the names"),
        pytest.param("\n".join([*LINES[:9], "% paused, 3", "// on", *LINES[9:]]), "t", id="signs"),
        pytest.param("\n".join([*LINES[:9], LINES[0], *LINES[9:]]), "t", id="the header again"),
    ],
)
def test_a_table_has_the_numbers_that_people_wrote(
    tmp_path: Path, text: str | bytes, first: str
) -> None:
    table = TextTable(written(tmp_path, text))
    assert table.columns("") == [first, *NAMES[1:]]
    assert (table.read("", [first, *NAMES[1:]])[:, 1:] == ROWS).all()


def test_a_row_without_a_time_is_no_header(tmp_path: Path) -> None:
    times = ["" if k % 7 == 0 else f"{0.005 * k:.4f}" for k in range(COUNT)]
    table = TextTable(written(tmp_path, lines_of(times)))
    assert table.columns("") == NAMES
    assert np.flatnonzero(np.isnan(table.read("", ["t"])[:, 0])).tolist() == [*range(0, COUNT, 7)]


@pytest.mark.parametrize("before", ["true,", "HOVER,"])
def test_words_before_the_numbers_of_each_row_are_no_numbers(tmp_path: Path, before: str) -> None:
    times = [f"{0.005 * k:.4f}" for k in range(COUNT)]
    text = lines_of(times, f"mode,{','.join(NAMES)}", before=before)
    assert (TextTable(written(tmp_path, text)).read("", NAMES[1:]) == ROWS).all()


@pytest.mark.parametrize(
    "word",
    ["#N/A", "1.#IND", "-1.#INF", "1.#QNAN", "#DIV/0!", "--", "?", "n.a.", "<NA>", "-nan(ind)"],
)
def test_words_of_spreadsheets_and_compilers_are_missing_numbers(word: str) -> None:
    assert np.isnan(Cells().number(word))


@pytest.mark.parametrize(
    ("cells", "why"),
    [
        (["1.000,5"], "thousands"),
        (["1 000.5"], "thousands"),
        (["1\u00a0000"], "thousands"),
        (["1,000,000"], "thousands"),
        (["0,5", "9.805"], "another decimal mark"),
        (["0.5", "9,805"], "another decimal mark"),
        (["9_8"], "is no number"),
        (["0x10"], "is no number"),
        (["true"], "is no number"),
        (["2026-02-30T00:00:00Z"], "out of range"),
    ],
)
def test_no_cell_becomes_another_number(cells: list[str], why: str) -> None:
    numbers = Cells()
    for one in cells[:-1]:
        numbers.number(one)
    with pytest.raises(ValueError, match=why):
        numbers.number(cells[-1])


def iso(ns: int, zone: str, point: str = ".") -> str:
    return str(np.datetime64(int(ns), "ns")).replace(".", point) + zone


@pytest.mark.parametrize(
    ("cells", "unit"),
    [
        pytest.param([str(one) for one in STAMPS_NS], "ns", id="ns"),
        pytest.param([f"{one}e0" for one in STAMPS_NS], "ns", id="exponents"),
        pytest.param([f"{ns // 10**9}.{ns % 10**9:09d}" for ns in STAMPS_NS], "s", id="s"),
        pytest.param([iso(one, "Z") for one in STAMPS_NS], "s", id="dates"),
        pytest.param([f'"{iso(one, "", ",")}"' for one in STAMPS_NS], "s", id="decimal commas"),
        pytest.param([iso(one + 7200 * 10**9, "+02:00") for one in STAMPS_NS], "s", id="zones"),
    ],
)
def test_stamps_of_a_table_keep_each_nanosecond(
    tmp_path: Path, cells: list[str], unit: str
) -> None:
    stamps, rate, notes = read(written(tmp_path, lines_of(cells)), unit)
    assert (stamps == STAMPS_NS).all()
    assert (rate == ROWS[:, :3]).all()
    zoneless = any("no zone: they are taken as UTC" in one for one in notes)
    assert zoneless == (cells[0].startswith('"'))


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in zip(NAMES, [STAMPS_NS, *ROWS.T], strict=True):
            file[name] = values


def write_mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in zip(NAMES, [STAMPS_NS, *ROWS.T], strict=True):
            file[name] = values[None, :]
            file[name].attrs["MATLAB_class"] = b"double"
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))


def write_npy(path: Path, kind: str = "i8") -> None:
    rows = np.zeros(COUNT, [("t", kind), *((name, "f8") for name in NAMES[1:])])
    rows["t"] = STAMPS_NS.astype(kind)
    for name, values in zip(NAMES[1:], ROWS.T, strict=True):
        rows[name] = values
    with path.open("wb") as stream:
        np.save(stream, rows)


def arrow(values: Array | Stamps) -> pa.Array:
    """Return a column of Arrow; `pa.array` would load pandas."""
    whole = np.ascontiguousarray(values)
    kind = pa.int64() if whole.dtype.kind == "i" else pa.float64()
    return pa.Array.from_buffers(kind, len(whole), [None, pa.py_buffer(whole)])


def write_parquet(path: Path) -> None:
    times = arrow(STAMPS_NS).cast(pa.timestamp("ns", "UTC"))
    parquet.write_table(pa.table([times, *map(arrow, ROWS.T)], NAMES), path, row_group_size=25)


def write_mat(path: Path) -> None:
    values = [STAMPS_NS[:, None], *ROWS.T[:, :, None]]
    with path.open("wb") as stream:
        savemat(stream, dict(zip(NAMES, values, strict=True)))


@pytest.mark.parametrize(
    ("kind", "write"),
    [
        ("hdf5", write_hdf5),
        ("hdf5", write_mat73),
        ("npy", write_npy),
        ("npy", lambda path: write_npy(path, "M8[ns]")),
        ("parquet", write_parquet),
        ("mat", write_mat),
    ],
)
def test_integers_of_every_format_keep_each_nanosecond(
    tmp_path: Path, kind: str, write: Callable[[Path], None]
) -> None:
    path = tmp_path / "flight"
    write(path)
    assert format_of(path) == kind
    stamps, rate, _ = read(path, "ns")
    assert (stamps == STAMPS_NS).all()
    assert (rate == ROWS[:, :3]).all()


def test_a_matrix_that_opens_to_more_than_memory_is_for_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flight.mat"
    savemat(path, {"gyro": np.zeros(20_000_000)}, do_compression=True)
    assert path.stat().st_size < 200_000
    monkeypatch.setattr(limits, "MAX_FOREIGN", 40_000_000)
    with pytest.raises(LogFormatError, match=r"flight\.mat needs more than 40 MB of memory"):
        open_source(path, [])


def test_structures_are_paths_and_no_run_of_quadlab(tmp_path: Path) -> None:
    path = tmp_path / "flight.mat"
    savemat(path, {"imu": {"t": np.arange(9.0), "gyro": ROWS[:9, :3]}, "rate": 200.0})
    source = open_source(path, [])
    assert source.columns("") == ["imu.t", "imu.gyro[0]", "imu.gyro[1]", "imu.gyro[2]"]
    assert (source.read("", ["imu.gyro[1]"])[:, 0] == ROWS[:9, 1]).all()
    assert not is_exported(path)
    nested = tmp_path / "flight.parquet"
    missing = pa.Array.from_buffers(
        pa.float64(), COUNT, [pa.py_buffer(b"\xfd" + b"\xff" * 7), pa.py_buffer(ROWS.T[0].copy())]
    )
    gyro = pa.StructArray.from_arrays([missing], ["x"])
    parquet.write_table(pa.table([pa.StructArray.from_arrays([gyro], ["gyro"])], ["imu"]), nested)
    found = open_source(nested, []).read("", ["imu.gyro.x"])[:, 0]
    assert np.flatnonzero(np.isnan(found)).tolist() == [1]
    assert (np.delete(found, 1) == np.delete(ROWS[:, 0], 1)).all()
    assert not is_exported(tmp_path)


def test_a_stray_stamp_is_left_out_and_a_pause_is_not() -> None:
    stamps: Array = np.linspace(1.7e9, 1.7e9 + 0.995, 200)
    rows = np.arange(1, 201)
    for wrong in (0.0, 1e19, stamps[100] - 3600.0, stamps[100] + 3.0):
        stray = stamps.copy()
        stray[100] = wrong
        kept, [note] = without_strays(stray, rows, "flight.csv, [imu]")
        assert np.flatnonzero(~kept).tolist() == [100]
        assert "row 101" in note
    paused: Array = np.where(rows > 100, stamps + 3.0, stamps)
    again: Array = np.where(rows > 100, stamps - 0.5, stamps)
    for whole in (stamps, paused, again):
        assert without_strays(whole, rows, "")[0].all()


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        (PLAIN.replace("wx", "wx [deg/s]"), "s", 'angular_velocity_unit = "deg/s"'),
        (lines_of(f"{one:.10e}" for one in STAMPS_NS), "ns", "too few digits"),
        (lines_of(f"12:00:{0.005 * k:07.4f}" for k in range(COUNT)), "s", "is no number"),
        (SEMICOLONS.replace("9,", "1.009,"), "s", "thousands"),
        ("day;month\nMonday;May\n", "s", "which begin with 'day;month'"),
        (PLAIN.replace(".", ","), "s", "columns have no names (are there commas in numbers?)"),
        (
            lines_of(f"{5 + 0.005 * k - 0.1 * (k > 30):.3f}" for k in range(COUNT)),
            "s",
            "in row 32; was the clock set",
        ),
    ],
)
def test_a_refusal_says_what_is_wrong(tmp_path: Path, text: str, unit: str, words: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(LogFormatError) as refused:
        read(path, unit)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"PK\3\4" + bytes(60), "unpack it"),
        (gzip.compress(gzip.compress(b"t,a\n", mtime=0), mtime=0), "unpack it"),
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        (b"<!DOCTYPE html><html>", "a page of the web"),
        (b'{"t": 0.1}\n{"t": 0.2}\n', "JSON: write it as CSV"),
    ],
    ids=["zip", "gzip", "lfs", "html", "json"],
)
def test_what_people_take_for_a_log_is_named(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(LogFormatError, match=words):
        format_of(written(tmp_path, data, "flight.csv.gz"))


def test_a_pipe_is_refused_at_once_and_any_name_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", written(tmp_path, "x\n", "a\nb\x1b.csv")):
        assert main(["log", "import", str(path), "--mapping", "betaflight"]) == 1
        told = capsys.readouterr().err
        assert told.count("\n") == 1
        assert told.strip().isprintable()


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bag") / "flight", FLIGHT, 2, mcap=True)


def rewritten(bag: Path, path: Path, *, encoding: str = "cdr") -> Path:
    """Write the messages of a bag from the last to the first into an MCAP file."""
    [file] = bag.glob("*.mcap")
    with file.open("rb") as stream, path.open("wb") as target:
        messages = list(make_reader(stream).iter_messages())
        writer, channels = Writer(target), {}
        writer.start("ros2", "other")
        for schema, channel, message in reversed(messages):
            assert schema is not None
            if channel.topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, encoding, number)
            number = channels[channel.topic]
            writer.add_message(number, message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def test_a_bag_keeps_each_nanosecond_in_any_order(bag: Path, tmp_path: Path) -> None:
    stamps = np.round(FLIGHT.seconds * 1e9).astype(np.int64)
    older = write_bag(tmp_path / "flight.bag", FLIGHT, 1)
    assert open_source(older, ["/none"]).columns("/imu") == []
    for path in (bag, older, rewritten(bag, tmp_path / "reversed.mcap")):
        found = read_flight(path)
        assert (found.imu.stamps_ns == stamps).all()
        assert np.allclose(found.imu.angular_velocity_b, FLIGHT.rate)


def test_why_a_topic_cannot_be_read_is_said(bag: Path, tmp_path: Path) -> None:
    path = rewritten(bag, tmp_path / "other.mcap", encoding="json")
    with pytest.raises(LogFormatError, match="/imu cannot be read: its messages are in 'json'"):
        read_flight(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged = McapTables(written(tmp_path, bytes(data), "damaged.mcap"), ["/imu"])
    assert any("1 damaged chunks, whose messages are lost" in one for one in damaged.notes)


def test_a_missing_part_of_a_bag_is_noted(bag: Path, tmp_path: Path) -> None:
    folder = tmp_path / "flight"
    folder.mkdir()
    [file] = bag.glob("*.mcap")
    (folder / file.name).write_bytes(file.read_bytes())
    described = {"relative_file_paths": [file.name, "flight_1.mcap"]}
    text = json.dumps(described, indent=1).replace('"flight', '- "flight')
    (folder / "metadata.yaml").write_text(text)
    notes = open_source(folder, ["/imu"]).notes
    assert notes == ["flight: its metadata.yaml names flight_1.mcap, missing"]


@pytest.mark.filterwarnings("error")
def test_a_nan_of_any_kind_leaves_its_row_out(tmp_path: Path) -> None:
    rows = np.zeros(COUNT, [("t", "f8"), *((name, "f4") for name in NAMES[1:])])
    rows["t"] = 0.005 * np.arange(COUNT)
    for name, values in zip(NAMES[1:], ROWS.T, strict=True):
        rows[name] = values
    rows["wx"].view("u4")[7] = 0x7FA00000  # one that signals
    path = tmp_path / "flight.npy"
    np.save(path, rows)
    assert len(read(path)[0]) == COUNT - 1


def test_integers_beyond_64_bits_are_no_other_numbers(tmp_path: Path) -> None:
    path = tmp_path / "flight.npy"
    np.save(path, np.array([[2**64 - 1, 1], [3, 2]], np.uint64))
    assert open_source(path, []).read("", ["0"])[0, 0] == 2.0**64


PLAIN_LINES = ["1.5,2,3e-3", "-.25, +4 ,5.", '"6",1e400,7', "8,nan,-inf"]


@pytest.mark.parametrize(
    ("more", "plain"),
    [
        ("", True),
        ("\r\n\r\n9,10,11\r\n", True),
        ("\n9,10,\n", False),
        ("\n9,10,11,\n", False),
        ("\n# 9,10,11\n", False),
        ("\n9,10,1_1\n", False),
        ("\na,b,c\n", False),
    ],
    ids=repr,
)
def test_a_table_of_plain_numbers_is_the_same_cell_by_cell(
    tmp_path: Path, more: str, plain: bool
) -> None:
    path = tmp_path / "table.csv"
    path.write_text("a,b,c\n" + "\n".join(PLAIN_LINES) + more, newline="")
    table = TextTable(path)
    quick = PlainColumns(path, ",", 1, 3).numbers([2, 1])
    assert (quick is not None) == plain
    if quick is not None:
        table._plain = None
        assert np.array_equal(quick, table.read("", ["c", "b"]), equal_nan=True)


@pytest.mark.parametrize(
    "texts",
    [
        ["1700000000.123456789", "1700000000.223456788"],
        ["1403636579763555584", "-5"],
        ["1.7e9", "-3.25"],
        ["0.1234567891", "1"],
        ["9000000000.1", "9300000000.1"],
        ["1.1", "nan"],
    ],
    ids=repr,
)
def test_what_plain_numbers_have_beyond_float64_is_exact(tmp_path: Path, texts: list[str]) -> None:
    path = tmp_path / "table.csv"
    path.write_text("t,x\n" + "".join(f"{one},1\n" for one in texts))
    table = TextTable(path)
    quick = PlainColumns(path, ",", 1, 2).remainders(0)
    assert np.allclose(table.remainders("", "t"), [*map(remainder, texts)], rtol=0.0, atol=1e-16)
    assert (quick is None) == (texts[0] in ("0.1234567891", "9000000000.1", "1.1"))


def test_parquet_of_a_name_that_is_no_utf_8_is_read(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/fl\xfcg.parquet"))
    with path.open("wb") as file:
        parquet.write_table(pa.table({"x": [1.5, 2.5]}), file)
    assert ParquetTable(path).read("", ["x"]).tolist() == [[1.5], [2.5]]


def test_a_step_back_is_a_counter_only_where_it_has_all_values() -> None:
    rows = np.arange(1, 301)
    seconds = 0.01 * np.arange(300.0)
    seconds[-1] = -1.0  # 2^32 ns further it would go on
    found, notes = continued(seconds, rows, "f")
    assert found.tolist() == seconds.tolist()
    assert notes == []
    for least in (0, -(2**31)):
        wrapped = np.mod(2.0**32 - 1500.0 + 10.0 * np.arange(300.0), 2.0**32) + least
        found, notes = continued(wrapped, rows, "f")
        assert np.diff(found).tolist() == [10.0] * 299
        assert len(notes) == 1


def test_slow_rows_of_a_restarted_vehicle_are_no_counter() -> None:
    seconds = np.tile(50.0 + np.arange(8.0), 2)  # a battery at 1 Hz; 24 bits of us are 16.8 s
    found, notes = continued(seconds % 16.0, np.arange(1, 17), "f")
    assert notes == []
    assert found.tolist() == (seconds % 16.0).tolist()


def test_a_counter_is_continued_beside_a_real_step_back() -> None:
    wrapped = np.mod(2.0**32 - 1500.0 + 10.0 * np.arange(300.0), 2.0**32)
    wrapped[200:] -= 400.0
    found, [note] = continued(wrapped, np.arange(1, 301), "f")
    assert "begins anew in row 151" in note
    assert np.flatnonzero(np.diff(found) != 10.0).tolist() == [199]
    assert np.diff(found)[199] == -390.0


def test_a_numpy_file_whose_head_ends_within_brackets_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "flight.npy"
    np.save(path, np.zeros((3, 2)))
    path.write_bytes(path.read_bytes().replace(b"(3, 2), }", b"(3, 2,   "))
    with pytest.raises(LogFormatError, match="is not a complete NumPy file"):
        NumpyTable(path)


@pytest.mark.parametrize("scale", [9, 3, 12])
def test_decimals_of_parquet_are_exact_as_far_as_stamps_are(tmp_path: Path, scale: int) -> None:
    texts = [f"1700000000.{k}23456789"[: 11 + scale] for k in range(1, 9)] + ["-0.5"]
    column = pa.array([Decimal(one) for one in texts], pa.decimal128(30, scale))
    parquet.write_table(pa.table({"t": column}), tmp_path / "t.parquet")
    table = ParquetTable(tmp_path / "t.parquet")
    rounded, rest = table.read("", ["t"])[:, 0], table.remainders("", "t")
    assert rounded.tolist() == [float(one) for one in texts]
    assert rest is not None
    assert np.allclose(rest, [*map(remainder, texts)], rtol=0.0, atol=1e-15)
