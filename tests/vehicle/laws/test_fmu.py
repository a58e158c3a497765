"""Laws from FMUs: one of FMI 3 made by pythonfmu3, one of FMI 2 compiled from C."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from quadrotor.errors import UsageError
from tests.support.lab import Lab, flight_parameters
from vehicle.laws.contract import hovering
from vehicle.laws.fmu import FmuLaw

pytest.importorskip("fmpy", reason="the package fmpy is not installed")
HERE = Path(__file__).parent
SIZES = (
    ("position_w", 3),
    ("velocity_w", 3),
    ("quaternion_wb", 4),
    ("angular_velocity_b", 3),
    ("reference_position_w", 3),
    ("reference_velocity_w", 3),
    ("reference_acceleration_w", 3),
    ("inertia_b", 3),
    ("mass", 1),
    ("thrust", 1),
    ("torque_b", 3),
)
"""Variables of fmi2_law.c in the order of its value references."""


def made_by_gcc(folder: Path, rename: str = "") -> Path:
    """Build the FMU of FMI 2.

    Args:
        rename: "old=new", to rename a variable.
    """
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    binary = folder / "fmi2_law.so"
    words = ["gcc", "-O2", "-shared", "-fPIC", "-o", str(binary), str(HERE / "fmi2_law.c")]
    subprocess.run(words, check=True, timeout=60)
    names = [n if size == 1 else f"{n}[{k + 1}]" for n, size in SIZES for k in range(size)]
    old, _, new = rename.partition("=")
    rows, outputs = [], []
    for number, name in enumerate(names):
        is_output = name.startswith(("thrust", "torque"))
        start = "" if is_output else ' start="0.0"'
        exact = ' initial="calculated"' if is_output else ""
        rows.append(
            f'<ScalarVariable name="{new if name == old else name}" valueReference="{number}" '
            f'causality="{"output" if is_output else "input"}"{exact}><Real{start}/>'
            "</ScalarVariable>"
        )
        if is_output:
            outputs.append(f'<Unknown index="{number + 1}"/>')
    description = (
        '<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" '
        'modelName="fmi2_law" guid="{1}" variableNamingConvention="structured">'
        '<CoSimulation modelIdentifier="fmi2_law" canHandleVariableCommunicationStepSize="true"/>'
        f"<ModelVariables>{''.join(rows)}</ModelVariables><ModelStructure><Outputs>"
        f"{''.join(outputs)}</Outputs><InitialUnknowns>{''.join(outputs)}</InitialUnknowns>"
        "</ModelStructure></fmiModelDescription>"
    )
    path = folder / "compiled.fmu"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", description)
        file.write(binary, "binaries/linux64/fmi2_law.so")
    return path


def made_by_pythonfmu3(folder: Path) -> Path:
    from pythonfmu3.builder import FmuBuilder

    built: Path = FmuBuilder.build_FMU(
        HERE / "fmi3_law.py", dest=folder, needsExecutionTool="false"
    )
    return built.rename(folder / "python.fmu")


@pytest.fixture
def fly(tmp_path: Path) -> Iterator[Callable[[str], Lab]]:
    labs: list[Lab] = []

    def made(name: str) -> Lab:
        parameters = flight_parameters()
        parameters.control.law = name
        labs.append(Lab(parameters, plugins=tmp_path))
        return labs[-1]

    yield made
    for lab in labs:
        lab.stack.steering.close()


@pytest.mark.parametrize("build", [made_by_gcc, made_by_pythonfmu3])
def test_an_fmu_flies_the_vehicle(
    tmp_path: Path, fly: Callable[[str], Lab], build: Callable[[Path], Path]
) -> None:
    path = build(tmp_path)
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(path)) == []
    lab = fly(path.stem).hovering(settling=4.0)
    external = lab.stack.steering.external
    assert external is not None, lab.said
    assert external.flown
    assert external.missed == 0
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.06)


@pytest.mark.parametrize("build", [made_by_gcc, made_by_pythonfmu3])
def test_both_kinds_answer_the_numbers_of_the_law(
    tmp_path: Path, build: Callable[[Path], Path]
) -> None:
    law = FmuLaw(build(tmp_path))
    x = hovering(mass=1.2)
    thrust, torque_b = law.step(x)
    assert thrust == pytest.approx(1.2 * 9.81)
    assert torque_b == pytest.approx([0.0, 0.0, 0.0])
    x.reference_position_w[:] = (0.1, -0.2, 1.3)
    thrust, torque_b = law.step(x)
    assert thrust == pytest.approx(1.2 * (9.81 + 8.0 * 0.3))
    assert torque_b == pytest.approx([0.0154 * 60 * 0.8 / 9.81, 0.0154 * 60 * 0.4 / 9.81, 0.0])


@pytest.mark.parametrize(
    ("rename", "why"),
    [
        ("thrust=force", r"needs the outputs thrust and torque_b\[1\].*has force"),
        ("mass=weight", "unknown inputs weight; allowed are time, dt"),
        ("torque_b[2]=torque_y", "needs the outputs"),
    ],
)
def test_an_fmu_with_other_variables_is_refused_by_name(
    tmp_path: Path, rename: str, why: str
) -> None:
    with pytest.raises(UsageError, match=why):
        FmuLaw(made_by_gcc(tmp_path, rename))


def test_what_is_no_fmu_or_one_of_another_computer_is_told(
    tmp_path: Path, fly: Callable[[str], Lab]
) -> None:
    (tmp_path / "broken.fmu").write_bytes(b"no archive")
    lab = fly("broken").ready()
    assert "broken.fmu is not an FMU that fmpy can read" in lab.said
    assert lab.parameter("control.law") == "geometric"
    path = made_by_gcc(tmp_path)
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(other, "w") as new:
        new.writestr("modelDescription.xml", old.read("modelDescription.xml"))
        new.writestr("binaries/win64/fmi2_law.dll", b"MZ")
    with pytest.raises(UsageError, match=r"other.fmu does not start on this computer"):
        FmuLaw(other)
    assert {p.name for p in tmp_path.glob(".*")} == {".other.unpacked"}
