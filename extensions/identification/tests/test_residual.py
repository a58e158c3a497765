"""`quadlab identify residual`: known forces are found, and judged by flights that were not seen."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.evaluation.log_columns import FlownParameters
from extensions.identification.residual import command, figure, flights
from extensions.identification.residual.command import Identify
from extensions.identification.residual.fit import explained, fit_residual, ridge, split
from extensions.identification.residual.flights import FlightResidual, lagged, residual
from quadrotor.errors import MeasurementError, StorageError, UsageError
from quadrotor.records import Array
from quadrotor.vehicle_model import GRAVITY

MASS, ARM, RATIO = 1.308, 0.25, 0.0174
J = np.array([0.0154, 0.0154, 0.025])
DRAG, LEVER, LOSS = np.array([0.42, 0.52]), 0.02, 0.025
VALUES = {
    "model.mass": MASS,
    "model.arm": ARM,
    "model.torque_ratio": RATIO,
    "model.motor_time_constant": 0.047,
    "model.inertia_xx": J[0],
    "model.inertia_yy": J[1],
    "model.inertia_zz": J[2],
}
PARAMETERS = FlownParameters(dict(VALUES), {})
SEEN = dict(zip(("x", "y", "z", "roll", "pitch"), [*DRAG, LOSS, *LEVER * DRAG[::-1]], strict=True))


def flown(seed: int, size: float = 0.5, climb: float = 0.3, noise: float = 0.05) -> FlightResidual:
    """Return a flight of known drag, lever and loss of thrust, with a wind and noise of its own."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.02)
    phase = np.multiply.outer(time, [1.0, 1.7, 0.8]) + rng.uniform(0.0, 6.0, 3)
    v = np.sin(phase) * [size, size, climb]
    thrust = MASS * GRAVITY * (1.0 + 0.05 * np.sin(2.3 * time))
    drag = -DRAG * v[:, :2]
    force = np.column_stack((drag, -LOSS * thrust * v[:, 2]))
    torque = LEVER * np.column_stack((-drag[:, 1], drag[:, 0], 0.0 * time))
    return FlightResidual(
        f"flight{seed}",
        time,
        v,
        thrust,
        np.ones(len(time)),
        force + rng.normal(0.0, 0.2, 3) + rng.normal(0.0, noise, force.shape),
        torque + rng.normal(0.0, 0.01, 3) + rng.normal(0.0, 0.02 * noise, force.shape),
        PARAMETERS,
    )


def test_known_terms_are_found_whatever_the_wind_of_each_flight() -> None:
    found = fit_residual([flown(1), flown(2), flown(3)])
    assert found.quiet == {}
    for name, value in SEEN.items():
        one = found.found[name]
        assert one.value == pytest.approx(value, rel=0.05)
        assert abs(one.value - value) < 4.0 * one.deviation
        assert one.good
        assert one.left < one.rms
    assert found.found["x"].explained > 0.85
    assert found.simulator() == {
        "simulator.rotor_drag_x": pytest.approx(0.42, abs=0.02),
        "simulator.rotor_drag_y": pytest.approx(0.52, abs=0.02),
        "simulator.inflow_loss": pytest.approx(0.025, abs=0.002),
        "simulator.drag_lever": pytest.approx(0.02, abs=0.002),
    }
    assert found.model()["model.drag"] == pytest.approx(0.47, abs=0.02)


def test_a_single_flight_is_judged_by_its_thirds() -> None:
    found = fit_residual([flown(1)])
    assert found.parts == 3
    assert found.found["y"].value == pytest.approx(0.52, rel=0.1)


def test_an_axis_that_was_not_excited_is_named_and_left_out() -> None:
    found = fit_residual([flown(1, climb=0.01), flown(2, climb=0.01)])
    assert list(found.quiet) == ["z"]
    assert "z" not in found.found
    with pytest.raises(
        MeasurementError, match=r"\(m/s rms: x 0\.01 of 0\.3, y 0\.01 of 0\.3, z 0\.01 of 0\.08\)"
    ):
        fit_residual([flown(1, size=0.01, climb=0.01)])


def test_a_short_flight_is_refused() -> None:
    short = split(flown(1), 5)[0]
    with pytest.raises(MeasurementError, match=r"4\.0 s of free flight are too short, 6 s"):
        fit_residual([short])


def test_neither_noise_nor_a_push_along_the_motion_is_proposed() -> None:
    calm = flown(1)
    noise = np.random.default_rng(5).normal(0.0, 0.3, calm.force_b.shape)
    found = fit_residual([replace(calm, force_b=noise)])
    assert not found.found["x"].good
    assert "simulator.rotor_drag_x" not in found.simulator()
    pushed = fit_residual([replace(calm, force_b=-calm.force_b)])
    assert pushed.found["x"].explained > 0.85
    assert pushed.model() == {}


def test_a_penalty_shrinks_and_held_out_parts_tell_noise_from_force() -> None:
    rng = np.random.default_rng(2)
    A, c = rng.normal(size=(200, 2)), np.array([2.0, -1.0])
    assert ridge([A], [A @ c], 0.0) == pytest.approx(c, abs=1e-12)
    scale = np.sqrt(np.mean(A**2, axis=0))
    B = A / scale
    shrunk = np.linalg.solve(B.T @ B + 200 * np.eye(2), B.T @ (A @ c)) / scale
    assert ridge([A], [A @ c], 1.0) == pytest.approx(shrunk, abs=1e-12)
    halves = [A[:100], A[100:]]
    assert explained(halves, [one @ c for one in halves], 0.0) == pytest.approx(1.0)
    assert explained(halves, [rng.normal(size=100), rng.normal(size=100)], 0.0) < 0.05


def test_the_residual_of_the_model_itself_is_nothing() -> None:
    """The rotors lag, and the vehicle turns as their torque makes it."""
    dt, n = 0.002, 4000
    time = dt * np.arange(float(n))
    thrusts: Array = 3.2 + 0.3 * np.sin(np.multiply.outer(time, [3.0, 2.0, 2.5, 1.5]))
    speeds = lagged(time, np.sqrt(thrusts), 0.047)
    f1, f2, f3, f4 = (speeds**2).T
    tau = np.column_stack((ARM * (f2 - f4), ARM * (f3 - f1), RATIO * (f1 - f2 + f3 - f4)))
    omega = np.zeros((n, 3))
    for k in range(n - 1):
        turn = (tau[k] - np.cross(omega[k], J * omega[k])) / J
        omega[k + 1] = omega[k] + dt * turn
    force = np.zeros((n, 3))
    force[:, 2] = (speeds**2).sum(axis=1) / MASS
    velocity = np.zeros((n, 3))
    *_, force_b, torque_b = residual(time, force, np.hstack((velocity, omega)), thrusts, VALUES)
    assert np.abs(force_b).max() < 1e-12
    settled = time > 1.0
    assert np.abs(torque_b[settled]).max() < 0.02 * np.abs(tau).max()


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that lets every log be one of these flights, in their order."""

    def use(*ones: FlightResidual) -> None:
        turn = iter(ones)
        monkeypatch.setattr(command, "check_log_file", lambda log: None)
        monkeypatch.setattr(flights, "read_residual", lambda log, vehicle: next(turn))

    return use


def test_the_command_proposes_settings_and_draws_what_is_left(
    read: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    read(flown(1), flown(2, climb=0.01), flown(1), flown(2))
    picture, logs = tmp_path / "left.svg", (Path("a.mcap"), Path("b.mcap"))
    assert Identify("residual", logs, plot=picture).run() == 0
    told = capsys.readouterr().out
    assert "each of 2 flights by a fit to the others" in told
    assert "for the vehicle: --set model.drag=0.4" in told
    assert "simulator.rotor_drag_y=0.5" in told
    assert picture.read_text().count("rms left") == 10
    assert Identify("residual", logs, json=True).run() == 0
    assert json.loads(capsys.readouterr().out)["found"]["x"]["unit"] == "N s/m"


def test_mistakes_are_told_before_anything_is_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="LOG is missing; give one log"):
        Identify("residual", ()).run()
    with pytest.raises(StorageError, match=r"none\.mcap is not a file"):
        Identify("residual", (tmp_path / "none.mcap",)).run()
    with pytest.raises(UsageError, match=r"--plot a\.txt2: no picture ends in '\.txt2'"):
        figure.check_plot(Path("a.txt2"))
