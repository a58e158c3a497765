"""Tables as people write them, stamps that cannot be, and values that no sensor measures."""

from __future__ import annotations

import gzip
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from zstandard import ZstdCompressor

from extensions.importers.flight import ImportedFlight
from extensions.importers.importing import read_flight
from extensions.importers.readers.cells import Cells
from extensions.importers.readers.formats import format_of
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.foreign_flight import (
    columns_of,
    make_flight,
    write_csv,
    write_mapping,
)
from quadlab.__main__ import main
from quadrotor.errors import LogFormatError
from quadrotor.extension import Importer
from quadrotor.records import Array

FLIGHT = make_flight()
COLUMNS = ["t", "wx", "wy", "wz", "ax", "ay", "az"]
SECONDS = np.linspace(0.0, 0.995, 200)
EPOCH_NS = 1_403_636_579_763_555_584
MAPPING = """
vehicle = "people"
[imu]
time = "{time}"
time_unit = "{unit}"
angular_velocity = {rate}
angular_velocity_unit = "rad/s"
specific_force = ["ax", "ay", "az"]
specific_force_unit = "m/s^2"
body = "FLU"
"""


def samples() -> Array:
    """Return 200 samples of an IMU at rest, (200, 6): rad/s and m/s^2."""
    random = np.random.default_rng(5)
    return random.normal([0, 0.2, 0, 0, 0, 9.8], [0.01] * 3 + [0.05] * 3, (200, 6))


def lines_of(
    stamps: list[str], names: list[str] = COLUMNS, delimiter: str = ",", end: str = "\n"
) -> str:
    """Return a table with a header, numbers with four decimals."""
    rows = [[t, *(f"{x:.4f}" for x in row)] for t, row in zip(stamps, samples(), strict=True)]
    return "".join(delimiter.join(row) + end for row in [names, *rows])


def imported(
    folder: Path, text: str | bytes, *, time: str = "t", unit: str = "s", rate: str = ""
) -> ImportedFlight:
    path = folder / "flight.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    mapping = folder / "mapping.toml"
    rate = rate or '["wx", "wy", "wz"]'
    mapping.write_text(MAPPING.format(time=time, unit=unit, rate=rate))
    return read_flight(path, str(mapping))


def seconds(values: Array = SECONDS) -> list[str]:
    return [f"{t:.4f}" for t in values]


PLAIN = lines_of(seconds())
UNITS = "s,rad/s,rad/s,rad/s,m/s2,m/s2,m/s2"


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(PLAIN.replace("\n", "\r\n"), id="lines of Windows"),
        pytest.param(PLAIN.replace("\n", "\r\n") + "\r\n\r\n", id="blank lines at the end"),
        pytest.param("\ufeff" + PLAIN, id="byte order mark"),
        pytest.param(PLAIN.encode("utf-16"), id="UTF-16"),
        pytest.param(b"# made in K\xf6ln\n" + PLAIN.encode(), id="Latin-1"),
        pytest.param(PLAIN.replace("az\n", f"az\n{UNITS}\n", 1), id="row of units"),
        pytest.param(PLAIN.replace(",", ";").replace(".", ","), id="decimal commas"),
        pytest.param(PLAIN.replace(",", "\t").replace(".", ","), id="decimal commas, tabs"),
        pytest.param(PLAIN.replace(",", " "), id="spaces"),
        pytest.param(PLAIN.replace(",", "   ").replace("\n", "  \n"), id="several spaces"),
        pytest.param(PLAIN.replace("\n", ",\n"), id="a comma behind each row"),
        pytest.param(PLAIN.replace("az\n", "az\n# a remark, with a comma\n", 1), id="remarks"),
        pytest.param(PLAIN.replace("t,wx", "t (s),wx [rad/s]", 1), id="units in names"),
    ],
)
def test_a_table_as_people_write_it_is_read_with_its_numbers(
    tmp_path: Path, text: str | bytes
) -> None:
    found = imported(tmp_path, text)
    assert np.allclose(found.imu.angular_velocity_b, samples()[:, :3], atol=5.1e-5)
    assert np.allclose(found.imu.specific_force_b, samples()[:, 3:], atol=5.1e-5)
    assert np.allclose(np.diff(found.imu.stamps_ns), 5e6, atol=1e3)


def test_names_with_commas_and_an_empty_column(tmp_path: Path) -> None:
    names = ["t", *(f'"Gyro, {axis} (rad/s)"' for axis in "xyz"), "ax", "ay", "az"]
    text = lines_of(seconds(), names).replace("\n", ",\n")
    found = imported(tmp_path, text, rate='["Gyro, x", "Gyro, y", "Gyro, z"]')
    assert np.allclose(found.imu.angular_velocity_b, samples()[:, :3], atol=5.1e-5)


def test_numbers_that_are_missing_in_words_leave_their_rows_out(tmp_path: Path) -> None:
    rows = PLAIN.splitlines()
    for k, word in enumerate(("nan", "", "N/A", "null", "inf", "-"), 3):
        cells = rows[k].split(",")
        rows[k] = ",".join([cells[0], word, *cells[2:]])
    found = imported(tmp_path, "\n".join(rows) + "\n")
    assert len(found.imu.stamps_ns) == 194
    assert any("6 of 200 rows without numbers left out" in note for note in found.notes)


TWICE = ["t", "wx", "wx", "wz", "ax", "ay", "az"]
MS = [f"{1e3 * t:.1f}" for t in SECONDS]
NS = [str(EPOCH_NS + 5_000_000 * k) for k in range(200)]
WRAPS = [str((2**32 - 8000 + 5000 * k) % 2**32) for k in range(200)]


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        pytest.param(lines_of(seconds(), TWICE), "s", "'wx' is ambiguous, 2 columns", id="names"),
        pytest.param(PLAIN.replace("9.8", "9_8"), "s", "'9_8", id="underscores"),
        pytest.param(
            PLAIN.replace(",", ";").replace("9.8", "1.234,5", 3), "s", "thousands", id="thousands"
        ),
        pytest.param(PLAIN.replace("0.2", "a.2", 4), "s", "is no number", id="letters"),
        pytest.param(PLAIN[:4000] + "\n1.0,2.0\n" + PLAIN[4050:], "s", "has 2 values", id="short"),
        pytest.param(PLAIN, "ms", 'write time_unit = "s", which fits', id="seconds called ms"),
        pytest.param(PLAIN, "ns", 'write time_unit = "s", which fits', id="seconds called ns"),
        pytest.param(lines_of(MS), "s", 'write time_unit = "ms", which fits', id="ms called s"),
        pytest.param(lines_of(NS), "s", 'beyond any date (2106): write time_unit = "ns"', id="ns"),
        pytest.param(
            lines_of(["0", *NS[1:]]), "ns", "row 2 is 44.5 years after row 1", id="first is 0"
        ),
        pytest.param(
            lines_of([*NS[:-1], NS[-1] + "000000000"]), "ns", "row 200 is", id="last is huge"
        ),
        pytest.param(
            lines_of(seconds(np.concatenate([SECONDS[:100], SECONDS[:100]]))),
            "s",
            "in row 101",
            id="two flights",
        ),
        pytest.param(PLAIN.replace("t,", "t [ms],", 1), "s", 'time_unit = "ms"', id="header"),
        pytest.param(PLAIN.replace("0.2", "1e300"), "s", "cannot have been measured", id="1e300"),
    ],
)
def test_what_would_become_another_number_is_refused_in_a_line(
    tmp_path: Path, text: str, unit: str, words: str
) -> None:
    with pytest.raises(LogFormatError) as refused:
        imported(tmp_path, text, unit=unit)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_counter_that_begins_anew_is_continued(tmp_path: Path) -> None:
    found = imported(tmp_path, lines_of(WRAPS), unit="us")
    assert (np.diff(found.imu.stamps_ns) == 5_000_000).all()
    assert any("a counter of 32 bits, which begins anew in row 3" in one for one in found.notes)


def test_a_few_values_beyond_physics_are_left_out_and_named(tmp_path: Path) -> None:
    rows = PLAIN.splitlines()
    cells = rows[101].split(",")
    rows[101] = ",".join([cells[0], "1e300", *cells[2:]])
    found = imported(tmp_path, "\n".join(rows))
    assert len(found.imu.stamps_ns) == 199
    assert any("the first in row 101: 1e+300; left out" in note for note in found.notes)


def packed_by_zstd(data: bytes) -> bytes:
    return ZstdCompressor().compress(data)


@pytest.mark.parametrize(("ending", "pack"), [("gz", gzip.compress), ("zstd", packed_by_zstd)])
def test_a_compressed_file_is_unpacked(
    tmp_path: Path, ending: str, pack: Callable[[bytes], bytes]
) -> None:
    imported(tmp_path, PLAIN)
    path = tmp_path / f"flight.csv.{ending}"
    path.write_bytes(pack(PLAIN.encode()))
    found = read_flight(path, str(tmp_path / "mapping.toml"))
    assert np.allclose(found.imu.specific_force_b, samples()[:, 3:], atol=5.1e-5)
    path.write_bytes(pack(PLAIN.encode()) + pack(PLAIN[PLAIN.index("\n") + 1 :].encode())[:-40])
    with pytest.raises(LogFormatError, match=r"is incomplete.* ends within a compressed frame"):
        read_flight(path, str(tmp_path / "mapping.toml"))
    path.write_bytes(pack(PLAIN.encode())[:20])
    with pytest.raises(LogFormatError, match="cannot be unpacked"):
        read_flight(path, str(tmp_path / "mapping.toml"))


def test_what_there_is_of_a_compressed_file_that_is_cut_off_is_imported(tmp_path: Path) -> None:
    imported(tmp_path, PLAIN)
    path = tmp_path / "flight.csv.gz"
    path.write_bytes(gzip.compress(PLAIN.encode())[:-1000])
    found = read_flight(path, str(tmp_path / "mapping.toml"), torn=True)
    rows = len(found.imu.stamps_ns)
    assert 50 < rows < 200
    assert np.allclose(found.imu.specific_force_b, samples()[:rows, 3:], atol=5.1e-5)


@pytest.mark.parametrize("packed", [False, True])
def test_a_single_mcap_of_ros_is_read_as_its_folder_is(tmp_path: Path, packed: bool) -> None:
    bag = write_bag(tmp_path / "flight", FLIGHT, 2, mcap=True)
    [file] = bag.glob("*.mcap")
    alone = tmp_path / "alone.mcap"
    alone.write_bytes(file.read_bytes())
    if packed:
        alone = tmp_path / "alone.mcap.zstd"
        alone.write_bytes(packed_by_zstd(file.read_bytes()))
    whole, found = read_flight(bag), read_flight(alone)
    assert (found.imu.stamps_ns == whole.imu.stamps_ns).all()
    assert (found.imu.angular_velocity_b == whole.imu.angular_velocity_b).all()
    assert whole.truth is not None
    assert found.truth is not None
    for name, values in found.truth.states.items():
        assert (values == whole.truth.states[name]).all()


def test_what_an_mcap_has_instead_is_listed(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", FLIGHT, 2, mcap=True)
    [file] = bag.glob("*.mcap")
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        '[imu]\ntable = "/camera"\ntime = "stamp"\nangular_velocity = "a"\nspecific_force = "b"\n'
    )
    with pytest.raises(LogFormatError, match="no table '/camera'; there are /imu, /pose"):
        read_flight(file, str(mapping))


def test_a_run_of_quadlab_and_a_name_that_is_no_utf_8(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    imported(tmp_path, PLAIN)
    path = tmp_path / os.fsdecode(b"fl\xfcg.csv")
    path.write_text(PLAIN)
    words = ["--mapping", str(tmp_path / "mapping.toml"), "--data", str(tmp_path / "lab")]
    assert main(["log", "import", str(path), *words]) == 0
    assert "fl\ufffdg.csv" in capsys.readouterr().out
    [log] = (tmp_path / "lab" / "runs").glob("*/station.mcap")
    for own in (log.parent, log):
        assert main(["log", "import", str(own)]) == 1
        assert "is a run of quadlab already" in capsys.readouterr().err


def test_a_format_is_recognised_by_a_pattern_after_all_beginnings(tmp_path: Path) -> None:
    path = tmp_path / "flight"
    path.write_bytes((1_700_000_000_000_000).to_bytes(8, "big") + b"\xfd\x09\0\0")
    assert format_of(path) == "tlog"
    path.write_bytes((1_700_000_000_000_000).to_bytes(8, "big") + b"\xfc\x09\0\0")
    with pytest.raises(LogFormatError, match="unknown format"):
        format_of(path)
    with pytest.raises(ValueError, match="needs starts or a pattern"):
        Importer(name="none", target=".a:b")


@pytest.mark.parametrize("text", ["11/30/2026 12:00:00", "30.11.2026 12:00", "2026-11-30"])
def test_dates_of_other_forms_are_refused_with_the_form_that_is_read(text: str) -> None:
    with pytest.raises(ValueError, match="another form than is read: write it like 2026-"):
        Cells().number(text)


@pytest.mark.parametrize(
    "units", ["{s},{rad/s},{rad/s},{rad/s},{m/s2},{m/s2},{m/s2}", "sec.,r,r,r,x,x,x"]
)
def test_a_row_of_units_in_braces_or_of_unknown_ones_names_no_columns(
    tmp_path: Path, units: str
) -> None:
    names, *rows = lines_of([f"{one:.3f}" for one in SECONDS]).splitlines(keepends=True)
    found = imported(tmp_path, "".join([names, units + "\n", *rows]))
    assert len(found.imu.stamps_ns) == 200


def test_a_column_without_any_number_is_named(tmp_path: Path) -> None:
    names, *rows = lines_of([f"{one:.3f}" for one in SECONDS]).splitlines(keepends=True)
    cells = [one.split(",") for one in rows]
    text = names + "".join(",".join([*one[:2], "", *one[3:]]) for one in cells)
    with pytest.raises(LogFormatError, match=r"there is no number in wy$"):
        imported(tmp_path, text)


def test_an_attitude_beyond_any_scale_is_left_out(tmp_path: Path) -> None:
    columns = columns_of(make_flight(seconds=3.0))
    columns["qx"][100] = 1e200
    write_mapping(tmp_path / "m.toml", 'angular_velocity_unit = "rad/s"')
    path = write_csv(tmp_path / "flight.csv", columns)
    found = read_flight(path, str(tmp_path / "m.toml"))
    assert found.truth is not None
    assert len(found.truth.stamps_ns) == len(columns["t"]) - 1
    assert any("quaternion: 1 of 300 rows" in note and "row 101" in note for note in found.notes)
