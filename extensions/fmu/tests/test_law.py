"""Laws from FMUs: one of FMI 3 made by pythonfmu3, and our own law exported for FMI 2."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from extensions.fmu.description import export_fmu
from extensions.fmu.models import LAW
from extensions.fmu.plugin import FmuPlugin
from extensions.fmu.tests.fmus import MANIFEST, renamed
from quadrotor.checkout import ROOT
from quadrotor.errors import UsageError
from quadrotor.parameters import ParameterStore
from tests.support.lab import Lab, flight_parameters
from vehicle.laws.contract import LAW as CONTRACT
from vehicle.laws.contract import hovering

pytestmark = pytest.mark.needs("gcc")
SLAVE = ROOT / "benchmarks" / "flights" / "fmi3_geometric.py"
Build = Callable[[str], Path]


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Build]:
    """Return the FMU of a law: ours of FMI 2 or 3, "gcc2" and "gcc3", or that of `quadlab new
    law` by "pythonfmu3"; each is made once."""

    @cache
    def built(kind: str) -> Path:
        folder = tmp_path_factory.mktemp("fmu")
        path = folder / f"{kind}.fmu"
        if kind != "pythonfmu3":
            export_fmu(LAW, [], path, int(kind[-1]))
            return path
        from pythonfmu3.builder import FmuBuilder

        made: Path = FmuBuilder.build_FMU(SLAVE, dest=folder, needsExecutionTool="false")
        return made.rename(path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("QUADLAB_ROOT", str(ROOT))  # for the slave, also in a process of its own
        yield built


@pytest.fixture
def fly() -> Iterator[Callable[[Path], Lab]]:
    labs: list[Lab] = []

    def made(path: Path) -> Lab:
        parameters = flight_parameters()
        parameters.control.law = path.stem
        labs.append(Lab(parameters, plugins=path.parent))
        return labs[-1]

    yield made
    for lab in labs:
        lab.stack.law.close()


@pytest.mark.parametrize("kind", ["gcc2", "pythonfmu3"])
def test_an_fmu_flies_the_vehicle(fly: Callable[[Path], Lab], build: Build, kind: str) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(build(kind))) == []
    lab = fly(build(kind)).hovering(settling=0.5)
    external = lab.stack.law.external
    assert external is not None, lab.said
    assert external.flown
    assert external.missed == 0
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.06)


@pytest.mark.parametrize("kind", ["gcc2", "gcc3", "pythonfmu3"])
def test_all_kinds_answer_the_numbers_of_the_law(build: Build, kind: str) -> None:
    law, lift = FmuPlugin(CONTRACT, build(kind)), 9.81 + 8.0 * 0.3
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
    build: Build, fmi: int
) -> None:
    law, x = FmuPlugin(CONTRACT, build(f"gcc{fmi}")), hovering(mass=1.2)
    x.reference_position_w[2], x.flying = 1.1, 0.0  # so that no integral grows
    gain = float(ParameterStore(law.parameters).get("control_position_kp_z"))
    assert law.step(x)[0] == pytest.approx(1.2 * (9.81 + 0.1 * gain))
    ParameterStore(law.parameters).set({"control_position_kp_z": 12.5})
    for _ in range(2):
        assert law.step(x)[0] == pytest.approx(1.2 * (9.81 + 1.25))
        law.reset()


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("thrust", "force", r"as law it needs the outputs thrust and torque_b\[1\].*has force"),
        ("mass", "weight", "unknown inputs weight; allowed are time, dt"),
        ("torque_b[2]", "torque_y", "needs the outputs"),
    ],
)
def test_an_fmu_with_other_variables_is_refused_by_name(
    tmp_path: Path, build: Build, old: str, new: str, why: str
) -> None:
    with pytest.raises(UsageError, match=why):
        FmuPlugin(CONTRACT, renamed(build("gcc2"), {old: new}, tmp_path))


def test_what_is_no_fmu_or_one_of_another_computer_is_told(
    tmp_path: Path, fly: Callable[[Path], Lab], build: Build
) -> None:
    (tmp_path / "broken.fmu").write_bytes(b"no archive")
    lab = fly(tmp_path / "broken.fmu").ready()
    assert "broken.fmu is not an FMU that fmpy can read" in lab.said
    assert lab.parameter("control.law") == "geometric"
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(build("gcc2")) as old, zipfile.ZipFile(other, "w") as new:
        new.writestr(MANIFEST, old.read(MANIFEST))
        new.writestr("binaries/win64/quadlab_law.dll", b"MZ")
    with pytest.raises(UsageError, match=r"other.fmu does not start on this computer"):
        FmuPlugin(CONTRACT, other)
    assert {p.name for p in tmp_path.glob(".*")} == {".other.unpacked"}
