"""Plant: ground, flight, drag, rotors, battery, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from quadrotor.records import STATE, Record
from quadrotor.rotations import euler_from_quaternion, quaternion_from_euler, quaternion_to_matrix
from quadrotor.vehicle_model import mixing_matrix, reference_of_thrust
from tests.support.dynamics import derivative
from vehicle.simulator.air import blow, ground_gain
from vehicle.simulator.battery import open_voltage
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import advance, configure_plant, new_plant

Array = npt.NDArray[np.float64]

OFF = (0, 0, 0, 0)
G = 9.81


def state(plant: Record) -> Record:
    view: Record = plant["x"].view(STATE).reshape(1)
    return view


def run(plant: Record, references: tuple[int, int, int, int], seconds: float) -> None:
    for _ in range(round(seconds * 500)):
        advance(plant, references, 0.002)


def flying(parameters: SimulatorParameters) -> Record:
    """Return a plant high up, at rest, with the rotor speeds that hover the nominal vehicle."""
    plant = new_plant(parameters)
    plant["x"][0, 2] = 100.0
    plant["rotor_speeds"] = 127.0
    return plant


def hover_reference(parameters: SimulatorParameters) -> float:
    p = parameters
    return reference_of_thrust(p.mass * G / 4, p.motor_slope, p.motor_offset)


# ---------------------------------------------------------------- ground
def test_it_rests_level_at_z_0_and_feels_g() -> None:
    plant = new_plant(SimulatorParameters())
    run(plant, OFF, 2.0)
    assert state(plant)["position_w"][0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert state(plant)["quaternion_wb"][0] == pytest.approx([1, 0, 0, 0], abs=1e-12)
    assert plant["specific_force_b"][0] == pytest.approx([0, 0, G], abs=1e-9)


def test_dropped_askew_it_comes_to_rest_level_on_the_ground() -> None:
    plant = new_plant(SimulatorParameters())
    state(plant)["position_w"] = (0.0, 0.0, 0.3)
    state(plant)["quaternion_wb"] = quaternion_from_euler(0.2, -0.3, 1.0)
    run(plant, OFF, 4.0)
    assert state(plant)["position_w"][0, 2] == pytest.approx(0.0, abs=1e-4)
    roll, pitch, _ = euler_from_quaternion(state(plant)["quaternion_wb"][0])
    assert (roll, pitch) == pytest.approx((0, 0), abs=1e-3)
    assert np.abs(plant["x"][0, 3:6]).max() < 1e-3


def test_a_heavier_vehicle_settles_at_z_0_too() -> None:
    plant = new_plant(SimulatorParameters())
    configure_plant(plant, SimulatorParameters(mass=1.608))
    run(plant, OFF, 3.0)
    assert state(plant)["position_w"][0, 2] == pytest.approx(0.0, abs=1e-6)


def test_below_the_hover_reference_it_stays_on_the_ground_and_above_it_leaves() -> None:
    parameters = SimulatorParameters()
    hover = hover_reference(parameters)
    low, high = math.floor(hover) - 3, math.ceil(hover) + 3
    for reference, flies in ((low, False), (high, True)):
        plant = new_plant(parameters)
        run(plant, (reference,) * 4, 3.0)
        assert bool(state(plant)["position_w"][0, 2] > 0.1) is flies


def test_friction_brakes_a_slide_at_mu_g() -> None:
    plant = new_plant(SimulatorParameters(ground_friction=0.5))
    state(plant)["velocity_w"] = (2.0, 0.0, 0.0)
    run(plant, OFF, 0.2)
    assert state(plant)["velocity_w"][0, 0] == pytest.approx(2.0 - 0.5 * G * 0.2, rel=0.02)
    run(plant, OFF, 1.0)
    assert state(plant)["velocity_w"][0, 0] == pytest.approx(0.0, abs=1e-6)


def test_friction_brakes_a_spin() -> None:
    plant = new_plant(SimulatorParameters())
    state(plant)["angular_velocity_b"] = (0.0, 0.0, 3.0)
    run(plant, OFF, 1.0)
    assert state(plant)["angular_velocity_b"][0, 2] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("speed", [1.0, 5.0, 10.0])
def test_a_hard_landing_loses_energy(speed: float) -> None:
    plant = new_plant(SimulatorParameters())
    state(plant)["position_w"] = (0.0, 0.0, 0.05)
    state(plant)["velocity_w"] = (0.0, 0.0, -speed)
    highest = 0.0
    for _ in range(1500):
        advance(plant, OFF, 0.002)
        highest = max(highest, float(state(plant)["velocity_w"][0, 2]))
    assert np.isfinite(plant["x"]).all()
    assert highest < 0.7 * math.hypot(speed, math.sqrt(2 * G * 0.05))


# ---------------------------------------------------------------- flight
def test_in_free_fall_nothing_is_felt() -> None:
    plant = new_plant(SimulatorParameters())
    state(plant)["position_w"] = (0.0, 0.0, 10.0)
    run(plant, OFF, 0.5)
    assert plant["specific_force_b"][0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert state(plant)["position_w"][0, 2] == pytest.approx(10.0 - 0.5 * G * 0.25, abs=1e-9)


def test_drag_slows_exponentially() -> None:
    parameters = SimulatorParameters(drag=0.5)
    plant = new_plant(parameters)
    state(plant)["position_w"] = (0.0, 0.0, 50.0)
    state(plant)["velocity_w"] = (4.0, 0.0, 0.0)
    run(plant, OFF, 1.0)
    expected = 4.0 * math.exp(-0.5 / parameters.mass)
    assert state(plant)["velocity_w"][0, 0] == pytest.approx(expected, rel=1e-3)


def test_rotors_follow_with_the_time_constant() -> None:
    plant = new_plant(SimulatorParameters(motor_time_constant=0.05))
    run(plant, (100, 50, 0, 200), 0.05)
    share = 1 - math.exp(-0.05 / 0.05)
    assert plant["rotor_speeds"][0] == pytest.approx([100 * share, 50 * share, 0, 200 * share])


@pytest.mark.parametrize(
    ("references", "axis", "sign"),
    [
        ((120, 130, 120, 110), 0, 1.0),  # left up: rolls right, positive about x
        ((110, 120, 130, 120), 1, 1.0),  # rear up: pitches nose down, positive about y
        ((130, 110, 130, 110), 2, 1.0),  # motors 1 and 3 give positive yaw torque
    ],
)
def test_which_motors_turn_it_which_way(
    references: tuple[int, int, int, int], axis: int, sign: float
) -> None:
    plant = new_plant(SimulatorParameters())
    state(plant)["position_w"] = (0.0, 0.0, 10.0)
    run(plant, references, 0.1)
    omega = state(plant)["angular_velocity_b"][0]
    assert omega[axis] * sign > 0.05
    # Thrust is not linear in the reference: it causes a little yaw.
    assert np.abs(np.delete(omega, axis)).max() < 0.02 * abs(omega[axis])


def test_thrust_efficiency_scales_what_the_rotors_lift() -> None:
    forces = []
    for efficiency in (1.0, 0.938):
        plant = new_plant(SimulatorParameters(thrust_efficiency=efficiency))
        state(plant)["position_w"] = (0.0, 0.0, 10.0)
        run(plant, (127,) * 4, 0.5)
        forces.append(float(plant["specific_force_b"][0, 2]))
    assert forces[1] / forces[0] == pytest.approx(0.938)


def test_a_disturbance_accelerates_by_force_over_mass() -> None:
    parameters = SimulatorParameters()
    plant = new_plant(parameters)
    state(plant)["position_w"] = (0.0, 0.0, 20.0)
    plant["disturbance_w"] = (2.0, -1.0, 0.5)
    run(plant, OFF, 1.0)
    expected = np.array([2.0, -1.0, 0.5]) / parameters.mass - [0, 0, G]
    assert state(plant)["velocity_w"][0] == pytest.approx(expected, rel=1e-9)


def test_odd_periods_are_cut_into_steps_of_at_most_a_millisecond() -> None:
    plants = [new_plant(SimulatorParameters()) for _ in range(2)]
    for plant in plants:
        state(plant)["position_w"] = (0.0, 0.0, 10.0)
    for _ in range(300):
        advance(plants[0], (140, 130, 140, 130), 1 / 300)
    for _ in range(1000):
        advance(plants[1], (140, 130, 140, 130), 1 / 1000)
    assert plants[0]["x"][0] == pytest.approx(plants[1]["x"][0], abs=2e-3)


def test_a_second_of_varying_commands_is_integrated_exactly() -> None:
    """Rotors, drag and body against an eighth-order scheme on all 17 numbers at once."""
    rng = np.random.default_rng(7)
    truth = SimulatorParameters(drag=0.4, wind_x=2.0, motor_gain_left=0.9, thrust_efficiency=0.95)
    plant = flying(truth)
    plant["x"][0, 3:6], plant["x"][0, 10:13] = (1.0, -2.0, 0.5), (0.3, -0.2, 0.4)
    model, gains = plant["model"][0], plant["motor_gain"][0]
    mixing = mixing_matrix(truth.arm, truth.torque_ratio)
    J, wind = model["inertia_b"], np.array([2.0, 0.0, 0.0])

    def derivatives(_: float, y: Array, references: Array) -> Array:
        out = np.empty(17)
        force_w = -truth.drag * (y[3:6] - wind)
        thrusts = (truth.motor_slope * (y[13:] + truth.motor_offset)) ** 2
        wrench = mixing @ (truth.thrust_efficiency * gains * thrusts)
        derivative(y[:13].copy(), wrench, force_w, truth.mass, J, out[:13])
        out[13:] = (references - y[13:]) / truth.motor_time_constant
        return out

    exact = np.concatenate([plant["x"][0], plant["rotor_speeds"][0]])
    for _ in range(500):
        a, b, c, d = references = rng.integers(115, 140, 4).tolist()
        advance(plant, (a, b, c, d), 0.002)
        exact = solve_ivp(
            derivatives,
            (0.0, 0.002),
            exact,
            "DOP853",
            rtol=1e-12,
            atol=1e-13,
            args=(np.array(references, float),),
        ).y[:, -1]
    away = np.abs(plant["x"][0] - exact[:13])
    assert away[3:6].max() < 2e-6, "m/s"
    assert away[10:13].max() < 2e-6, "rad/s"
    assert away[0:3].max() < 2e-6, "m"
    force_w = -truth.drag * (exact[3:6] - wind)
    lift = (
        truth.thrust_efficiency
        * gains
        @ (truth.motor_slope * (exact[13:] + truth.motor_offset)) ** 2
    )
    felt = quaternion_to_matrix(exact[6:10]).T @ force_w + [0.0, 0.0, lift]
    assert plant["specific_force_b"][0] == pytest.approx(felt / truth.mass, abs=1e-5)


# ---------------------------------------------------------------- battery
def test_the_battery_is_15_v_in_its_middle() -> None:
    parameters = SimulatorParameters(battery_charge=0.5)
    plant = new_plant(parameters)
    run(plant, (127,) * 4, 1.0)
    assert open_voltage(0.5) == pytest.approx(15.28)
    assert plant["voltage"][0] == pytest.approx(14.6, abs=0.3)


def test_voltage_falls_with_power_and_with_time() -> None:
    plant = new_plant(SimulatorParameters())
    run(plant, OFF, 1.0)
    idle = float(plant["voltage"][0])
    run(plant, (127,) * 4, 1.0)
    hover = float(plant["voltage"][0])
    run(plant, (127,) * 4, 20.0)
    assert idle > hover + 0.3
    assert plant["voltage"][0] < hover - 0.05
    run(plant, OFF, 0.5)
    assert hover < plant["voltage"][0] < idle


def test_hover_lasts_around_ten_minutes() -> None:
    parameters = SimulatorParameters()
    plant = new_plant(parameters)
    run(plant, (127,) * 4, 1.0)
    before = float(plant["charge"][0])
    run(plant, (127,) * 4, 1.0)
    minutes = before / (before - float(plant["charge"][0])) / 60
    assert 9 < minutes < 14


def test_an_empty_battery_stays_at_zero_charge() -> None:
    plant = new_plant(SimulatorParameters(battery_charge=0.0))
    run(plant, (180,) * 4, 2.0)
    assert plant["charge"][0] == 0.0
    assert 7 < plant["voltage"][0] < 12


@pytest.mark.parametrize("exponent", [0.0, 1.0])
def test_a_sagging_battery_turns_rotors_slower_by_its_exponent(exponent: float) -> None:
    full, low = (
        new_plant(SimulatorParameters(battery_exponent=exponent, battery_charge=charge))
        for charge in (1.0, 0.2)
    )
    lifted = []
    for plant in (full, low):
        plant["x"][0, 2] = 10.0
        plant["rotor_speeds"] = 127.0
        voltage = float(plant["voltage"][0])
        advance(plant, (127, 127, 127, 127), 0.002)
        lifted.append((float(plant["specific_force_b"][0, 2]), voltage))
    (more, high), (less, sagged) = lifted
    assert less / more == pytest.approx((sagged / high) ** (2.0 * exponent), rel=1e-9)


def test_a_cell_holds_its_voltage_long_and_drops_at_the_end() -> None:
    cells = [open_voltage(charge) / 4 for charge in (1.0, 0.9, 0.5, 0.2, 0.1, 0.0)]
    assert cells == sorted(cells, reverse=True)
    assert cells[0] == pytest.approx(4.2)
    slope_middle = (cells[2] - cells[3]) / 0.3
    slope_end = (cells[4] - cells[5]) / 0.1
    assert slope_end > 10 * slope_middle
    assert open_voltage(1.7) == open_voltage(1.0)


def test_wind_carries_what_has_drag() -> None:
    for drag, reached in ((0.0, 0.0), (0.5, 4.0 * (1 - np.exp(-0.5 * 3.0 / 1.308)))):
        plant = flying(SimulatorParameters(drag=drag, wind_x=4.0))
        run(plant, (0,) * 4, 3.0)
        assert plant["x"][0, 3] == pytest.approx(reached, abs=0.01)


def test_gusts_have_dryden_s_deviation_and_spectra() -> None:
    from scipy.signal import welch

    deviation, time, dt, count = 2.0, 0.5, 0.01, 400_000
    plant = new_plant(SimulatorParameters(gust=deviation, gust_time=time, wind_y=1.0))
    noise = np.random.default_rng(4).standard_normal((count, 3))
    air = np.empty((count, 3))
    for k in range(count):
        blow(plant, noise, k, dt)
        air[k] = plant["air_w"][0]
    assert air.mean(0) == pytest.approx([0.0, 1.0, 0.0], abs=0.2)
    assert air.std(0) == pytest.approx([deviation] * 3, rel=0.05)
    frequency, power = welch(air, 1.0 / dt, nperseg=2048, axis=0)
    inside = (frequency > 0.1) & (frequency < 5.0)
    s = (2.0 * np.pi * frequency[inside] * time) ** 2
    along = 4.0 * deviation**2 * time / (1.0 + s)
    across = 2.0 * deviation**2 * time * (1.0 + 3.0 * s) / (1.0 + s) ** 2
    for axis, shape in ((1, along), (0, across), (2, across)):  # the wind is along y
        ratio = power[inside, axis] / shape
        assert ratio.mean() == pytest.approx(1.0, abs=0.05)
        assert np.polyfit(np.log(frequency[inside]), ratio, 1)[0] == pytest.approx(0.0, abs=0.05)


def test_rotor_drag_brakes_along_each_axis_and_lifts_the_leading_side() -> None:
    p = SimulatorParameters(rotor_drag_x=0.4, rotor_drag_y=0.6, drag_lever=0.05)
    plant = flying(p)
    plant["x"][0, 3:6] = 2.0, -1.0, 0.0
    advance(plant, (127,) * 4, 0.001)
    m, J = float(plant["model"]["mass"][0]), plant["model"]["inertia_b"][0]
    assert plant["specific_force_b"][0, :2] == pytest.approx([-0.4 * 2.0 / m, 0.6 / m], rel=2e-3)
    # Forwards and to the right: the nose goes up (-y), the right side up (-x).
    turned = plant["x"][0, 10:12] / 0.001
    wanted = [-0.6 * 1.0 * 0.05 / J[0], -0.4 * 2.0 * 0.05 / J[1]]
    assert turned == pytest.approx(wanted, rel=0.02)


def test_the_air_s_velocity_is_what_rotors_drag_against() -> None:
    plant = flying(SimulatorParameters(rotor_drag_x=0.4, rotor_drag_y=0.4, wind_x=3.0))
    plant["x"][0, 3] = 3.0
    advance(plant, (127,) * 4, 0.001)
    assert plant["specific_force_b"][0, :2] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(("climb", "share"), [(2.0, 0.95), (-2.0, 1.05), (-40.0, 1.5)])
def test_a_climbing_rotor_has_less_thrust(climb: float, share: float) -> None:
    lifts = []
    for loss in (0.0, 0.025):
        plant = flying(SimulatorParameters(inflow_loss=loss))
        plant["x"][0, 5] = climb
        advance(plant, (127,) * 4, 0.001)
        lifts.append(plant["specific_force_b"][0, 2])
    assert lifts[1] / lifts[0] == pytest.approx(share, abs=1e-3)


def test_near_the_ground_a_rotor_lifts_more() -> None:
    gains = [ground_gain(1.0, height) for height in (0.0, 0.1, 0.5, 2.0)]
    assert gains == sorted(gains, reverse=True)
    assert gains[0] == pytest.approx(1 / (1 - (0.127 / 0.6) ** 2))
    assert gains[-1] == ground_gain(0.0, 0.0) == 1.0


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_a_failed_motor_tips_the_vehicle_to_its_side(motor: int) -> None:
    plant = flying(SimulatorParameters(failed_motor=motor))
    run(plant, (127,) * 4, 0.3)
    roll_rate, pitch_rate = plant["x"][0, 10:12]
    # Front: nose down (+y); left: left side down (-x); rear: +; right: +.
    wanted = {1: (0, 1), 2: (-1, 0), 3: (0, -1), 4: (1, 0)}[motor]
    assert (roll_rate * wanted[0] + pitch_rate * wanted[1]) > 5.0


def test_a_weak_motor_is_a_torque() -> None:
    plant = flying(SimulatorParameters(motor_gain_left=0.9))
    run(plant, (127,) * 4, 0.2)
    assert plant["x"][0, 10] < -0.5
    assert abs(plant["x"][0, 11]) < 0.05


def test_a_payload_weighs() -> None:
    plant = flying(SimulatorParameters(payload=0.3))
    other = flying(SimulatorParameters(mass=1.608))
    for one in (plant, other):
        run(one, (127,) * 4, 0.5)
    assert plant["x"][0].tolist() == other["x"][0].tolist()
