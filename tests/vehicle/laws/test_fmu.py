"""Laws from FMUs: one of FMI 3 made by pythonfmu3, and our own law exported for FMI 2."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from quadlab.fmu_export.description import export_fmu
from quadlab.fmu_export.models import LAW
from quadrotor.errors import UsageError
from quadrotor.parameters import ParameterStore
from tests.support.lab import Lab, flight_parameters
from vehicle.laws.contract import hovering
from vehicle.laws.fmu import FmuLaw

pytest.importorskip("fmpy", reason="the package fmpy is not installed")
HERE = Path(__file__).parent
MANIFEST = "modelDescription.xml"


def exported(folder: Path, rename: str = "", fmi: int = 2) -> Path:
    """Return our own law as an FMU. Args: rename: "old=new", the name of a variable."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    path = folder / "exported.fmu"
    export_fmu(LAW, [], path, fmi)
    old, _, new = rename.partition("=")
    return rewritten(path, lambda text: text.replace(f'name="{old}"', f'name="{new}"'))


def rewritten(path: Path, change: Callable[[str], str]) -> Path:
    """Return the FMU with another description."""
    with zipfile.ZipFile(path) as file:
        files = {name: file.read(name) for name in file.namelist()}
    files[MANIFEST] = change(files[MANIFEST].decode()).encode()
    with zipfile.ZipFile(path, "w") as file:
        for name, data in files.items():
            file.writestr(name, data)
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
        lab.stack.law.close()


@pytest.mark.parametrize("build", [exported, made_by_pythonfmu3])
def test_an_fmu_flies_the_vehicle(
    tmp_path: Path, fly: Callable[[str], Lab], build: Callable[[Path], Path]
) -> None:
    path = build(tmp_path)
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(path)) == []
    lab = fly(path.stem).hovering(settling=2.5)
    external = lab.stack.law.external
    assert external is not None, lab.said
    assert external.flown
    assert external.missed == 0
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.06)


@pytest.mark.parametrize(
    ("build", "lift"), [(exported, 9.81 + 8.0 * 0.3), (made_by_pythonfmu3, 9.81)]
)
def test_both_kinds_answer_the_numbers_of_the_law(
    tmp_path: Path, build: Callable[[Path], Path], lift: float
) -> None:
    """Args: lift: m/s², over which the law tilts what it wants sideways."""
    law = FmuLaw(build(tmp_path))
    x = hovering(mass=1.2)
    thrust, torque_b = law.step(x)
    assert thrust == pytest.approx(1.2 * 9.81)
    assert torque_b == pytest.approx([0.0, 0.0, 0.0])
    x.reference_position_w[:] = (0.1, -0.2, 1.3)
    thrust, torque_b = law.step(x)
    assert thrust == pytest.approx(1.2 * (9.81 + 8.0 * 0.3))
    expected = [0.0154 * 60 * 0.8 / lift, 0.0154 * 60 * 0.4 / lift, 0.0]
    assert torque_b == pytest.approx(expected, rel=0.005, abs=5e-4)


@pytest.mark.parametrize("fmi", [2, 3])
def test_its_tunable_parameters_act_at_the_next_step_and_stay_after_a_reset(
    tmp_path: Path, fmi: int
) -> None:
    law, x = FmuLaw(exported(tmp_path, fmi=fmi)), hovering(mass=1.2)
    x.reference_position_w[2], x.flying = 1.1, 0.0  # so that no integral grows
    gain = float(ParameterStore(law.parameters).get("control_position_kp_z"))
    assert law.step(x)[0] == pytest.approx(1.2 * (9.81 + 0.1 * gain))
    ParameterStore(law.parameters).set({"control_position_kp_z": 12.5})
    for _ in range(2):
        assert law.step(x)[0] == pytest.approx(1.2 * (9.81 + 1.25))
        law.reset()


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
        FmuLaw(exported(tmp_path, rename))


def test_what_is_no_fmu_or_one_of_another_computer_is_told(
    tmp_path: Path, fly: Callable[[str], Lab]
) -> None:
    (tmp_path / "broken.fmu").write_bytes(b"no archive")
    lab = fly("broken").ready()
    assert "broken.fmu is not an FMU that fmpy can read" in lab.said
    assert lab.parameter("control.law") == "geometric"
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(exported(tmp_path)) as old, zipfile.ZipFile(other, "w") as new:
        new.writestr(MANIFEST, old.read(MANIFEST))
        new.writestr("binaries/win64/quadlab_law.dll", b"MZ")
    with pytest.raises(UsageError, match=r"other.fmu does not start on this computer"):
        FmuLaw(other)
    assert {p.name for p in tmp_path.glob(".*")} == {".other.unpacked"}
