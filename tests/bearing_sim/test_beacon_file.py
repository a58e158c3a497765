"""Beacons from a file; an invalid one is refused with line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bearing_sim import PAPER_BEACONS, PRESETS, load_beacons
from bearing_sim.beacon_file import LARGEST
from quadrotor.errors import DegenerateGeometryError, MeasurementError, StorageError

GOOD = "id,x,y,z\n1,1,1,0.1\n2,-1,1,0.1\n3,-1,-1,0.1\n4,1,-1,0.1\n"


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "beacons.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    "content",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD.rstrip("\n"),
        "# measured on Monday\n\n" + GOOD.replace(",", " , "),
        GOOD.replace("id,x,y,z", "ID, X [m], Y (m), z"),
    ],
)
def test_the_same_beacons_are_read_from_what_programs_write(tmp_path: Path, content: str) -> None:
    assert load_beacons(written(tmp_path, content)) == PAPER_BEACONS


@pytest.mark.parametrize("name", PRESETS)
def test_a_written_set_is_read_back(tmp_path: Path, name: str) -> None:
    beacons = PRESETS[name]
    rows = [
        f"{id},{x!r},{y!r},{z!r}\n"
        for id, (x, y, z) in zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True)
    ]
    assert load_beacons(written(tmp_path, "id,x,y,z\n" + "".join(rows))) == beacons


@pytest.mark.parametrize(
    ("content", "line", "column", "says"),
    [
        ("", 1, 1, "the file is empty"),
        ("# nothing\n\n", 1, 1, "the file is empty"),
        ("1,1,1,0.1\n2,-1,1,0.1\n", 1, 1, "'1' where the header id,x,y,z has 'id'"),
        ("id,y,x,z\n", 1, 4, "'y' where the header id,x,y,z has 'x'"),
        ("id,x,y [mm],z\n", 1, 6, "y in 'mm'; positions are in m"),
        ("id;x;y;z\n", 1, 9, "1 of the 4 values"),
        (GOOD.replace("2,-1,1,0.1", "2,-1,1"), 3, 7, "3 of the 4 values"),
        (GOOD.replace("2,-1,1,0.1", "2,-1,1,0,1"), 3, 10, "5 values; allowed are 4"),
        (GOOD.replace("2,-1,1,0.1", "2,-1, one,0.1"), 3, 7, "y is 'one'; allowed is a finite"),
        (GOOD.replace("2,-1,1,0.1", "2,-1,1,nan"), 3, 8, "z is 'nan'; allowed is a finite"),
        (GOOD.replace("2,-1,1,0.1", "2,,1,0.1"), 3, 3, "x is ''; allowed is a finite"),
        (GOOD.replace("2,-1,1,0.1", "B2,-1,1,0.1"), 3, 1, "id 'B2'; allowed is an integer"),
        (GOOD.replace("2,-1,1,0.1", "-2,-1,1,0.1"), 3, 1, "id '-2'; allowed is an integer"),
        (GOOD.replace("2,-1,1,0.1", "1,-1,1,0.1"), 3, 1, "id 1 is already on line 2"),
        (GOOD.encode().replace(b"-1,-1", b"-1,\xff1"), 4, 6, "byte 0xff is not UTF-8 text"),
        (b"\x89PNG\r\n\x1a\n", 1, 1, "byte 0x89 is not UTF-8 text"),
    ],
)
def test_a_file_that_is_none_is_refused_with_line_and_column(
    tmp_path: Path, content: str | bytes, line: int, column: int, says: str
) -> None:
    path = written(tmp_path, content)
    with pytest.raises(MeasurementError) as refused:
        load_beacons(path)
    assert f"beacons {path}, line {line}, column {column}: " in str(refused.value)
    assert says in str(refused.value)


def test_geometry_is_refused_with_the_name_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "id,x,y,z\n" + "".join(f"{k},{k},{k},0.1\n" for k in range(4)))
    with pytest.raises(DegenerateGeometryError, match=r"beacons\.csv: all 4 beacons lie on one"):
        load_beacons(path)


def test_a_file_that_cannot_be_read_or_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="No such file"):
        load_beacons(tmp_path / "none.csv")
    with pytest.raises(StorageError, match="directory"):
        load_beacons(str(tmp_path))
    with pytest.raises(MeasurementError, match=f"more than {LARGEST} bytes"):
        load_beacons(written(tmp_path, GOOD + "#" * LARGEST))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200))
def test_no_bytes_do_worse_than_be_refused(tmp_path: Path, content: bytes) -> None:
    path = written(tmp_path, b"id,x,y,z\n" + content)
    try:
        beacons = load_beacons(path)
    except MeasurementError as refused:
        says = str(refused)
    else:
        says = repr(beacons)
        assert np.isfinite(beacons.positions_w).all()
    assert len(says.splitlines()) == 1
