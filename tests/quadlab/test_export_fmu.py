"""`quadlab export fmu`: FMUs in C that compute what our plant and our law compute."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control.controller import GeometricController
from quadlab.__main__ import main
from quadlab.fmu_export.description import base_unit, unit_name
from quadlab.fmu_export.models import LAW, PLANT
from quadrotor.records import ACTUATORS, new_reference, new_state
from quadrotor.rigid_body import rotor_thrust
from quadrotor.rotations import quaternion_from_euler
from vehicle.laws.contract import hovering
from vehicle.laws.external import REFERENCE_FIELDS
from vehicle.laws.fmu import FmuLaw
from vehicle.parameters import new_parameters
from vehicle.simulator.battery import charge_battery
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import advance, configure_plant, new_plant

needs_compiler = pytest.mark.skipif(
    shutil.which("gcc") is None, reason="gcc is not installed, on Debian: apt install gcc"
)
ALIKE = 1e-9
"""Largest difference of any output, in its unit."""
STATE = {"position_w": (0, 3), "velocity_w": (3, 3), "quaternion_wb": (6, 4)}
STATE |= {"angular_velocity_b": (10, 3)}
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
def export(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return the FMU with the defaults, written once."""
    pytest.importorskip("fmpy", reason="the package fmpy is not installed")
    folder = tmp_path_factory.mktemp("fmu")

    def exported(model: str) -> Path:
        path = folder / f"{model}.fmu"
        if not path.exists():
            assert main(["export", "fmu", model, "--out", str(path)]) == 0
        return path

    return exported


class Fmu:
    """One running instance; variables by name."""

    def __init__(self, path: Path, folder: Path, **start: float) -> None:
        import fmpy
        from fmpy.simulation import instantiate_fmu

        description = fmpy.read_model_description(str(path))
        self.variables = {one.name: one for one in description.modelVariables}
        fmpy.extract(str(path), str(folder))
        self.c: Any = instantiate_fmu(str(folder), description, "CoSimulation")
        for name, value in start.items():
            self.set(name, value)
        self.c.setupExperiment(startTime=0.0)
        self.c.enterInitializationMode()
        self.c.exitInitializationMode()
        self.time = 0.0

    def set(self, name: str, *values: float) -> None:
        self.c.setReal(self._places(name, len(values)), list(values))

    def get(self, name: str, size: int) -> list[float]:
        found: list[float] = self.c.getReal(self._places(name, size))
        return found

    def step(self, h: float) -> None:
        self.c.doStep(self.time, h)
        self.time += h

    def _places(self, name: str, size: int) -> list[int]:
        names = [name] if size == 1 else [f"{name}[{k + 1}]" for k in range(size)]
        return [self.variables[one].valueReference for one in names]


@pytest.fixture
def run(tmp_path: Path, export: Callable[[str], Path]) -> Iterator[Callable[..., Fmu]]:
    running: list[Fmu] = []

    def started(model: str, **start: float) -> Fmu:
        running.append(Fmu(export(model), tmp_path / f"{len(running)}", **start))
        return running[-1]

    yield started
    for one in running:
        one.c.freeInstance()


@needs_compiler
@pytest.mark.parametrize("model", [PLANT, LAW])
def test_an_exported_fmu_has_no_problem_and_is_the_same_file_each_time(
    tmp_path: Path, export: Callable[[str], Path], model: str
) -> None:
    from fmpy.validation import validate_fmu

    path = export(model)
    assert validate_fmu(str(path)) == []
    again = tmp_path / "again.fmu"
    assert main(["export", "fmu", model, "--out", str(again)]) == 0
    assert again.read_bytes() == path.read_bytes()


@needs_compiler
@pytest.mark.parametrize("values", [{}, ROUGH], ids=["clean", "rough"])
def test_the_plant_moves_as_the_simulators(
    run: Callable[..., Fmu], values: dict[str, float]
) -> None:
    """10 s from the floor, up, in the air, and down again, at 500 Hz."""
    parameters = SimulatorParameters(**values)
    plant, fmu = new_plant(parameters), run(PLANT, **values)
    random = np.random.default_rng(7)
    worst: dict[str, float] = {}
    for k in range(5000):
        if k % 10 == 0:
            hover = 112.0 if k < 2500 else 70.0
            references = hover + random.normal(0.0, 2.0, 4)
        advance(plant, references, 0.002)
        fmu.set("motor_references", *references)
        fmu.step(0.002)
        p = plant[0]
        expected = {n: p["x"][at : at + size] for n, (at, size) in STATE.items()}
        expected |= {n: p[n] for n in ("rotor_speeds", "specific_force_b")}
        expected["voltage"] = np.atleast_1d(p["voltage"])
        slope, offset = p["model"]["motor_slope"], p["model"]["motor_offset"]
        share = p["thrust_efficiency"] * p["battery_share"] * p["air_share"]
        thrusts = [rotor_thrust(float(n), slope, offset) for n in p["rotor_speeds"]]
        expected["thrusts"] = share * p["motor_gain"] * thrusts
        for name, numbers in expected.items():
            apart = float(np.abs(numbers - fmu.get(name, len(numbers))).max())
            worst[name] = max(worst.get(name, 0.0), apart)
    print(worst, plant["x"][0])
    assert max(worst.values()) <= ALIKE, worst
