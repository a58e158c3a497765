"""`quadlab export fmu`: FMUs in C that compute what our plant and our law compute."""

from __future__ import annotations

import math
import re
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control.controller import GeometricController
from control.parameters import RATES
from extensions.fmu.description import base_unit, unit_name
from extensions.fmu.models import LAW, PLANT, variables
from extensions.fmu.plugin import FmuPlugin
from quadlab.__main__ import main
from quadrotor.checkout import ROOT
from quadrotor.records import ACTUATORS, Record, new_reference, new_state
from quadrotor.rigid_body import rotor_thrust
from quadrotor.rotations import quaternion_from_euler
from quadrotor.vehicle_model import GRAVITY, reference_of_thrust
from vehicle.laws.contract import INPUT, Array, hovering
from vehicle.laws.contract import LAW as CONTRACT
from vehicle.parameters import new_parameters
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import advance, new_plant

ALIKE = 1e-9
"""Largest difference of any output, in its unit."""
ROUGH = {
    "mass": 1.5,
    "payload": 0.1,
    "inertia_yy": 0.02,
    "thrust_efficiency": 0.95,
    "motor_gain_left": 0.97,
    "drag": 0.2,
    "rotor_drag_x": 0.42,
    "rotor_drag_y": 0.52,
    "drag_lever": 0.02,
    "inflow_loss": 0.025,
    "wind_x": 2.0,
    "wind_z": -0.5,
    "push_y": 0.4,
    "ground_effect": 1.0,
    "battery_exponent": 0.8,
    "battery_charge": 0.3,
}


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return the FMU with the defaults, written once."""
    folder = tmp_path_factory.mktemp("fmu")

    def exported(model: str, fmi: int = 2) -> Path:
        path = folder / f"{model}{fmi}.fmu"
        if not path.exists():
            assert main(["export", "fmu", model, "--fmi", str(fmi), "--out", str(path)]) == 0
        return path

    return exported


class Fmu:
    """One running instance of FMI 2 or 3; variables by name."""

    def __init__(self, path: Path, folder: Path, **start: float) -> None:
        import fmpy
        from fmpy.simulation import instantiate_fmu

        description = fmpy.read_model_description(str(path))
        self._has_arrays = description.fmiVersion == "3.0"
        self.variables = {one.name: one for one in description.modelVariables}
        fmpy.extract(str(path), str(folder))
        self.c: Any = instantiate_fmu(str(folder), description, "CoSimulation")
        for name, value in start.items():
            self.set(name, value)
        if not self._has_arrays:
            self.c.setupExperiment(startTime=0.0)
        self.c.enterInitializationMode()
        self.c.exitInitializationMode()
        self.time = 0.0

    def set(self, name: str, *values: float) -> None:
        if self._has_arrays:
            self.c.setFloat64([self.variables[name].valueReference], list(values))
        else:
            self.c.setReal(self._places(name, len(values)), list(values))

    def choose(self, name: str, value: int) -> None:
        setter = self.c.setInt32 if self._has_arrays else self.c.setInteger
        setter([self.variables[name].valueReference], [value])

    def outputs(self) -> Array:
        """Return all outputs, in their order."""
        shown = [one for one in self.variables.values() if one.causality == "output"]
        places = [one.valueReference for one in shown]
        if self._has_arrays:
            sizes = [int(d.start) for one in shown for d in one.dimensions or ()]
            scalars = sum(not one.dimensions for one in shown)
            return np.array(self.c.getFloat64(places, nValues=sum(sizes) + scalars))
        return np.array(self.c.getReal(places))

    def step(self, h: float) -> None:
        self.c.doStep(self.time, h)
        self.time += h

    def _places(self, name: str, size: int) -> list[int]:
        names = [name] if size == 1 else [f"{name}[{k + 1}]" for k in range(size)]
        return [self.variables[one].valueReference for one in names]


@pytest.fixture
def run(tmp_path: Path, export: Callable[..., Path]) -> Iterator[Callable[..., Fmu]]:
    running: list[Fmu] = []

    def started(model: str, fmi: int = 2, **start: float) -> Fmu:
        running.append(Fmu(export(model, fmi), tmp_path / f"{len(running)}", **start))
        return running[-1]

    yield started
    for one in running:
        one.c.freeInstance()


@pytest.mark.needs("gcc")
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("model", [PLANT, LAW])
def test_an_exported_fmu_has_no_problem(export: Callable[..., Path], model: str, fmi: int) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(export(model, fmi))) == []


@pytest.mark.needs("gcc")
def test_the_functions_of_fmi_3_are_those_of_the_standards_header(
    tmp_path: Path, export: Callable[..., Path]
) -> None:
    """Compiled with the header of the standard that fmpy brings, in place of our own."""
    import fmpy

    with zipfile.ZipFile(export(PLANT, 3)) as file:
        file.extractall(tmp_path)
    own, header = tmp_path / "sources", Path(fmpy.__file__).parent / "c-code"
    text = (own / "fmi3.c").read_text()
    (own / "fmi3.h").unlink()
    standard = '#define EXPORTED\n#include "fmi3Functions.h"'
    (own / "fmi3.c").write_text(text.replace('#include "fmi3.h"', standard))
    words = ["gcc", "-std=c11", "-fsyntax-only", "-Werror=incompatible-pointer-types"]
    compiled = subprocess.run(
        [*words, f"-I{header}", str(own / "fmi3.c")], capture_output=True, text=True, check=False
    )
    assert compiled.returncode == 0, compiled.stderr
    declared = set(
        re.findall(
            r"^FMI3_Export fmi3\w+TYPE +(fmi3\w+);",
            (header / "fmi3Functions.h").read_text(),
            re.MULTILINE,
        )
    )
    ours = (
        set(re.findall(r"\b(fmi3[A-Z]\w+)\(", text))
        | {
            f"fmi3{way}{kind}"
            for kind in re.findall(r"NONE_OF\((\w+)\)", text)
            for way in ("Get", "Set")
        }
        | set(re.findall(r"REFUSED\((fmi3\w+)", text))
    )
    assert len(declared) > 70
    assert declared - ours == set()


@pytest.mark.needs("gcc")
def test_the_same_words_write_the_same_file(tmp_path: Path, export: Callable[[str], Path]) -> None:
    again = tmp_path / "again.fmu"
    assert main(["export", "fmu", LAW, "--out", str(again)]) == 0
    assert again.read_bytes() == export(LAW).read_bytes()


@pytest.mark.needs("gcc")
@pytest.mark.parametrize(
    ("values", "height", "fmi"),
    [({}, 0.0, 2), (ROUGH, 5.0, 2), (ROUGH, 5.0, 3)],
    ids=["clean", "rough", "rough, FMI 3"],
)
def test_the_plant_moves_as_the_simulators(
    run: Callable[..., Fmu], values: dict[str, float], height: float, fmi: int
) -> None:
    """10 s at 500 Hz: up, turning over, and down onto the floor."""
    parameters = SimulatorParameters.model_validate(values)
    plant, fmu = new_plant(parameters), run(PLANT, fmi, start_z=height, **values)
    plant["x"][:, 2] = height
    random = np.random.default_rng(7)
    worst, highest = np.zeros(25), 0.0
    for _ in range(500):
        # As a body of this mass needs to rise for 2 s, and to sink later.
        wanted = parameters.mass * (1.5 if fmu.time < 2.0 else 0.6) * GRAVITY / 4.0
        hover = reference_of_thrust(wanted, parameters.motor_slope, parameters.motor_offset)
        a, b, c, d = (hover + random.normal(0.0, 2.0, 4)).tolist()
        fmu.set("motor_references", a, b, c, d)
        for _ in range(10):
            advance(plant, (a, b, c, d), 0.002)
            fmu.step(0.002)
        apart = np.abs(outputs_of(plant) - fmu.outputs())
        worst = np.maximum(worst, apart)
        highest = max(highest, plant["x"][0, 2])
    assert highest > 1.0, "it did not fly"
    assert abs(plant["x"][0, 2]) < 0.5, "it did not come down"
    print("PLANT", worst)
    assert worst.max() <= ALIKE, worst


def outputs_of(plant: Record) -> Array:
    """Return a PLANT record's numbers in the order of the FMU's outputs."""
    p = plant[0]
    share = p["thrust_efficiency"] * p["battery_share"] * p["air_share"] * p["motor_gain"]
    slope, offset = p["model"]["motor_slope"], p["model"]["motor_offset"]
    thrusts = share * [rotor_thrust(float(n), slope, offset) for n in p["rotor_speeds"]]
    return np.hstack([p["x"], p["rotor_speeds"], thrusts, p["specific_force_b"], p["voltage"]])


@pytest.mark.needs("gcc")
def test_the_plant_starts_where_its_parameters_say(run: Callable[..., Fmu]) -> None:
    start = {"start_x": 1.0, "start_z": 2.0, "start_velocity_y": -3.0, "start_rotor_speed": 90.0}
    fmu = run(PLANT, start_roll=20.0, start_pitch=-10.0, start_yaw=130.0, **start)
    out = fmu.outputs()
    assert out[0:6].tolist() == [1.0, 0.0, 2.0, 0.0, -3.0, 0.0]
    assert out[6:10] == pytest.approx(quaternion_from_euler(*np.radians([20.0, -10.0, 130.0])))
    assert out[13:17].tolist() == [90.0] * 4


@pytest.mark.needs("gcc")
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("name", "value", "h"),
    [
        ("voltage", 1.0, 0.002),  # an output
        ("start_x", 1.0, 0.002),  # after the start
        ("mass", 1.0, -0.002),
        ("gust_w", math.nan, 0.002),
    ],
)
def test_the_fmu_refuses_what_cannot_be(
    run: Callable[..., Fmu], name: str, value: float, h: float, fmi: int
) -> None:
    from fmpy.fmi1 import FMICallException

    fmu = run(PLANT, fmi)
    if name == "gust_w" and fmi == 2:
        name = "gust_w[1]"
    with pytest.raises(FMICallException, match="status 3"):  # noqa: PT012 - either call
        fmu.set(name, value)
        fmu.step(h)


@pytest.mark.needs("gcc")
@pytest.mark.parametrize(("rates", "fmi"), [("nominal", 2), ("exact", 3)])
def test_the_law_answers_as_the_built_in(run: Callable[..., Fmu], rates: str, fmi: int) -> None:
    """300 ticks on seeded inputs, near hovering and far beyond every limit; integrals included."""
    parameters = new_parameters()
    parameters.control.attitude.rates = rates
    parameters.model.drag, parameters.model.drag_lever = 0.3, 0.03
    controller = GeometricController()
    fmu = run(LAW, fmi, **{"model.drag": 0.3, "model.drag_lever": 0.03})
    fmu.choose("control.attitude.rates", RATES.index(rates) + 1)
    random = np.random.default_rng(8)
    state, reference, out = new_state(), new_reference(), np.zeros(1, ACTUATORS)
    worst, seen = np.zeros(8), set()
    for k in range(300):
        size = 0.05 if k % 3 else 2.0
        x = hovering(mass=random.uniform(1.0, 1.6))
        x.inertia_b[:] = random.uniform(0.01, 0.03, 3)
        flying = k % 50 > 5
        for field in INPUT[4:16]:
            numbers = np.atleast_1d(getattr(x, field.name))
            numbers = numbers + size * random.normal(size=field.size)
            if field.name == "quaternion_wb":
                numbers /= np.linalg.norm(numbers)
            fmu.set(field.name, *numbers)
            at = reference if field.name.startswith("reference_") else state
            name = field.name.removeprefix("reference_")
            at[name] = numbers if field.size > 1 else numbers[0]
        fmu.set("mass", x.mass)
        fmu.set("inertia_b", *x.inertia_b)
        fmu.set("flying", flying)
        fmu.set("reset", k % 100 == 99)
        model = parameters.model.record()
        model["mass"], model["inertia_b"] = x.mass, x.inertia_b
        controller.configure(parameters.control, model)
        if k % 100 == 99:
            controller.reset()
        controller.step(state, reference, flying, 0.002, out)
        fmu.step(0.002)
        expected = np.hstack([out["wrench"][0], out["motor_references"][0]])
        worst = np.maximum(worst, np.abs(expected - fmu.outputs()))
        seen.add((bool(controller.tilt_limited), out["scaling"].item() == 1.0))
    print("LAW", worst)
    assert len(seen) == 4, "not every limit was met"
    assert worst.max() <= ALIKE, worst


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["sheep"], 2, "'plant', 'law'"),
        ([PLANT, "--set", "mas=1"], 2, "did you mean mass"),
        ([PLANT, "--set", "simulator.mass=9"], 2, "allowed 0.02 to 2.4 kg"),
        ([PLANT, "--set", "mass=nan"], 2, "finite"),
        ([PLANT, "--set", "start_pitch=91"], 2, "allowed -90 to 90 deg"),
        ([PLANT, "--set", "gust=1"], 2, "the FMU of the plant does not have it"),
        ([LAW, "--set", "control.disturbance.force=true"], 2, "the FMU of the law does not have"),
        ([LAW, "--set", "control.preset=observer"], 2, "control.disturbance.force"),
    ],
)
def test_wrong_words_are_answered_in_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], status: int, said: str
) -> None:
    assert main(["export", "fmu", *words, "--out", str(tmp_path / "x.fmu")]) == status
    line = capsys.readouterr().err
    assert said in line
    assert line.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_and_a_missing_compiler_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    for out, status, said in (
        ("no/x.fmu", 1, "there is no folder"),
        ("x.zip", 2, "must end in .fmu"),
        ("x.fmu", 1, "apt install gcc"),
    ):
        assert main(["export", "fmu", PLANT, "--out", str(tmp_path / out)]) == status
        line = capsys.readouterr().err
        assert said in line
        assert line.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_document_names_every_variable() -> None:
    text = (ROOT / "docs/extending/fmu_export.md").read_text()
    groups = ("control.position.", "control.attitude.", "control.limits.")
    inputs = {field.name for field in INPUT}  # of the law: on the page of external laws
    for model in (PLANT, LAW):
        for one in variables(model, ()):
            name = one.name.partition("[")[0]
            named = name.startswith(groups) or (name in inputs and model == LAW)
            assert named or f"`{name}`" in text, f"{name} of the {model}"


@pytest.mark.parametrize(
    ("unit", "name", "base"),
    [
        ("N s/m", "N.s/m", {"kg": 1, "m": 0, "s": -1}),
        ("1/s²", "1/s2", {"s": -2}),
        ("A h", "A.h", {"A": 1, "s": 1, "factor": 3600.0}),
        ("√N", "sqrtN", None),
    ],
)
def test_units_are_told_in_base_units(unit: str, name: str, base: dict[str, float] | None) -> None:
    assert unit_name(unit) == name
    assert base_unit(unit) == base


@pytest.mark.needs("gcc")
def test_set_changes_where_a_variable_starts(tmp_path: Path) -> None:
    import fmpy

    path = tmp_path / "mine.fmu"
    words = ["export", "fmu", LAW, "--out", str(path), "--set", "control.preset=stiff"]
    assert main([*words, "model.mass=1.4", "control.attitude.rates=exact"]) == 0
    description = fmpy.read_model_description(str(path))
    found = {one.name: one.start for one in description.modelVariables}
    assert found["control.position.kp_xy"] == "6.0"
    assert found["mass"] == "1.4"
    assert found["control.attitude.rates"] == "2"
    x = hovering(mass=1.4)
    law = FmuPlugin(CONTRACT, path)
    thrust, torque_b = law.step(x)
    assert thrust == pytest.approx(1.4 * GRAVITY)
    assert torque_b == pytest.approx([0.0] * 3)
    x.reference_position_w[0] += 0.1
    x.reset = x.flying = 0.0
    assert law.step(x)[1][1] > 0.05
    law.close()
