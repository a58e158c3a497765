"""Parameters of FMUs: read from the description, without running anything."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from extensions.fmu.parameters import ENTRIES, MOST, UNPACKED
from quadrotor.errors import UsageError
from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import ParameterStore
from vehicle.laws.contract import LAW
from vehicle.parameters import new_parameters
from vehicle.plugins import declared
from vehicle.plugins.host import load

FMI2 = """<fmiModelDescription fmiVersion="2.0">
<TypeDefinitions><SimpleType name="Gain"><Real unit="1/s" min="0" max="9"/></SimpleType>
</TypeDefinitions>
<ModelVariables>
 <ScalarVariable name="pid.k[1]" valueReference="7" causality="parameter" variability="tunable"
  description="proportional"><Real declaredType="Gain" start="2.5"/></ScalarVariable>
 <ScalarVariable name="pid.k(1)" valueReference="8" causality="parameter" variability="tunable">
  <Integer start="3"/></ScalarVariable>
 <ScalarVariable name="is" valueReference="9" causality="parameter" variability="tunable">
  <Boolean start="true"/></ScalarVariable>
 <ScalarVariable name="mass" valueReference="1" causality="parameter" variability="fixed">
  <Real start="1"/></ScalarVariable>
 <ScalarVariable name="title" valueReference="2" causality="parameter" variability="tunable">
  <String start="x"/></ScalarVariable>
</ModelVariables></fmiModelDescription>"""
FMI3 = """<fmiModelDescription fmiVersion="3.0"><ModelVariables>
 <Float64 name="k" valueReference="3" causality="parameter" variability="tunable" start="0.5"
  min="0"/>
 <Float64 name="table" valueReference="4" causality="parameter" variability="tunable" start="1 2">
  <Dimension start="2"/></Float64>
 <Int32 name="n" valueReference="5" causality="parameter" variability="tunable" start="2"/>
 <Float64 name="u" valueReference="6" causality="input" start="0"/>
</ModelVariables></fmiModelDescription>"""


@pytest.fixture(autouse=True)
def nothing_left() -> Iterator[None]:
    yield
    declared.offer(None)


def written(path: Path, description: str) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", description)
    return path


def described() -> dict[str, ParameterDescription]:
    """Return the parameters of plugins in a new tree, without their first word."""
    found = ParameterStore(new_parameters()).descriptions()
    own = "plugins."
    return {one.name.removeprefix(own): one for one in found if one.name.startswith(own)}


def test_a_tunable_parameter_of_an_fmu_has_its_unit_bounds_and_start(tmp_path: Path) -> None:
    written(tmp_path / "two.fmu", FMI2)
    written(tmp_path / "three.fmu", FMI3)
    assert declared.offer(tmp_path) == []
    found = described()
    kinds = {name: (one.type, one.default) for name, one in found.items()}
    assert kinds == {
        "two.pid_k_1": ("float", 2.5),
        "two.pid_k_1_2": ("int", 3),
        "two.is_": ("bool", True),
        "three.k": ("float", 0.5),
        "three.n": ("int", 2),
    }
    gain = found["two.pid_k_1"]
    assert (gain.unit, gain.minimum, gain.maximum) == ("1/s", 0.0, 9.0)
    assert gain.description == "proportional"
    assert (found["three.k"].minimum, found["three.k"].maximum) == (0.0, None)


@pytest.mark.parametrize(
    "content", [b"no archive", FMI2.replace('start="2.5"', 'start="many"'), "<open>"]
)
def test_an_fmu_whose_parameters_cannot_be_read_is_told_by_name(
    tmp_path: Path, content: bytes | str
) -> None:
    if isinstance(content, bytes):
        (tmp_path / "bad.fmu").write_bytes(content)
    else:
        written(tmp_path / "bad.fmu", content)
    (why,) = declared.offer(tmp_path)
    assert why.startswith("bad.fmu: its parameters cannot be read (")
    assert described() == {}


def test_of_very_many_the_first_are_shown(tmp_path: Path) -> None:
    one = FMI3[FMI3.index("<Float64") : FMI3.index("/>") + 2]
    many = "".join(one.replace('"k"', f'"k{n}"') for n in range(2 * MOST))
    written(tmp_path / "many.fmu", FMI3.replace(one, many))
    declared.offer(tmp_path)
    assert len(described()) == MOST


@pytest.mark.parametrize(
    ("sizes", "why"),
    [([UNPACKED // 2] * 3, "403 MB in 4 files"), ([0] * ENTRIES, "0 MB in 10001 files")],
)
def test_an_fmu_that_would_fill_the_disk_is_not_unpacked(
    tmp_path: Path, sizes: list[int], why: str
) -> None:
    path = written(tmp_path / "bomb.fmu", FMI2)
    zeros = bytes(1 << 20)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for k, size in enumerate(sizes):
            with file.open(f"resources/{k}", "w") as entry:
                for _ in range(size // len(zeros)):
                    entry.write(zeros)
    with pytest.raises(UsageError, match=f"bomb.fmu is {why} unpacked; allowed are 268 MB"):
        load(LAW, path)
    assert [one.name for one in tmp_path.iterdir()] == ["bomb.fmu"]


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param({8: 1 << 0}, id="encrypted"),
        pytest.param({8: 1 << 5}, id="patched"),
        pytest.param({10: 99}, id="a method of compression that is not known"),
        pytest.param({10: zipfile.ZIP_DEFLATED}, id="not compressed as stated"),
        pytest.param({22: 99, 26: 99}, id="shorter than stated"),
        pytest.param({42: 250}, id="elsewhere than stated"),
    ],
)
def test_a_damaged_fmu_is_one_line_and_the_others_are_offered(
    tmp_path: Path, damage: dict[int, int]
) -> None:
    data = bytearray(written(tmp_path / "damaged.fmu", FMI2).read_bytes())
    for place, value in damage.items():
        data[data.index(b"PK\x01\x02") + place] = value  # of the entry in the directory
    (tmp_path / "damaged.fmu").write_bytes(data)
    written(tmp_path / "whole.fmu", FMI2)
    (line,) = declared.offer(tmp_path)
    assert line.startswith("damaged.fmu: its parameters cannot be read (")
    assert any(name.startswith("whole.") for name in described())
