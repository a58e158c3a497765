"""The true vehicle: the true values of the model's quantities, and effects not in the model."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.parameters import parameter
from quadrotor.vehicle_model import VehicleModel
from vehicle.simulator.faults.table import CATALOGUE
from vehicle.simulator.tracking_systems.faults import TrackingFaults


def _matrix_entry(entry: str) -> float:
    same = entry[0] == entry[1]
    value: float = parameter(
        1.0 if same else 0.0,
        ge=0.5 if same else -0.2,
        le=1.5 if same else 0.2,
        step=0.001,
        description=f"entry {entry} of the true T in Sec. 5.2, which a calibration should find",
    )
    return value


class SimulatorParameters(VehicleModel):
    """True values of the simulated vehicle; the defaults match the flight stack's MK-Quadro model.

    Mass, inertia, geometry and motor law are those of VehicleModel. Noise is Gaussian, per sample.
    """

    seed: int = parameter(1, ge=0, le=2**31 - 1, step=1, read_only=True)
    """seed of all random numbers; the same seed gives the same bytes"""
    imu_rate: int = parameter(500, unit="Hz", ge=60, le=1000, step=10, read_only=True)
    """IMU samples a second over both ports, until the vehicle requests its own rate; `quadlab fly`
    requests this one"""
    firmware: str = parameter("python", choices=("python", "c"), read_only=True)
    """what the simulated microcontroller runs; both are equal to the count, and gcc builds the C
    one first"""
    start_x: float = parameter(0.0, unit="m", ge=-10.0, le=10.0, step=0.1, read_only=True)
    """start position on the floor, in W"""
    start_y: float = parameter(0.0, unit="m", ge=-10.0, le=10.0, step=0.1, read_only=True)
    """start position on the floor, in W"""
    thrust_efficiency: float = parameter(1.0, ge=0.5, le=1.2, step=0.001)
    """true thrust over the motor law's; 0.938 gives the 1.394 kg of Sec. 7"""
    payload: float = parameter(0.0, unit="kg", ge=0.0, le=1.0, step=0.05)
    """mass added at the centre, unknown to the flight stack"""
    motor_gain_front: float = parameter(1.0, ge=0.5, le=1.2, step=0.01)
    """true thrust of this motor over the others'"""
    motor_gain_left: float = parameter(1.0, ge=0.5, le=1.2, step=0.01)
    """true thrust of this motor over the others'"""
    motor_gain_rear: float = parameter(1.0, ge=0.5, le=1.2, step=0.01)
    """true thrust of this motor over the others'"""
    motor_gain_right: float = parameter(1.0, ge=0.5, le=1.2, step=0.01)
    """true thrust of this motor over the others'"""
    failed_motor: int = parameter(0, ge=0, le=4, step=1)
    """motor that spins without thrust: 1 front, 2 left, 3 rear, 4 right; 0 none"""
    missing_motor: int = parameter(0, ge=0, le=4, step=1)
    """motor whose controller does not answer on the bus: 1 to 4, 0 none"""
    drag: float = parameter(0.0, unit="N s/m", ge=0.0, le=2.0, step=0.01)
    """linear drag of the whole vehicle, relative to its velocity through the air"""
    rotor_drag_x: float = parameter(0.0, unit="N s/m", ge=0.0, le=2.0, step=0.01)
    """drag of the rotors along x_B, relative to the velocity through the air"""
    rotor_drag_y: float = parameter(0.0, unit="N s/m", ge=0.0, le=2.0, step=0.01)
    """drag of the rotors along y_B, relative to the velocity through the air"""
    inflow_loss: float = parameter(0.0, unit="s/m", ge=0.0, le=0.1, step=0.001)
    """share of the thrust lost for each m/s of climb through the air along z_B"""
    wind_x: float = parameter(0.0, unit="m/s", ge=-15.0, le=15.0, step=0.1)
    """steady wind along x_W; acts through the drag"""
    wind_y: float = parameter(0.0, unit="m/s", ge=-15.0, le=15.0, step=0.1)
    """steady wind along y_W; acts through the drag"""
    wind_z: float = parameter(0.0, unit="m/s", ge=-15.0, le=15.0, step=0.1)
    """steady wind along z_W; acts through the drag"""
    gust: float = parameter(0.0, unit="m/s", ge=0.0, le=10.0, step=0.1)
    """standard deviation of Dryden turbulence around the steady wind, per axis"""
    gust_time: float = parameter(1.0, unit="s", ge=0.05, le=20.0, step=0.05)
    """correlation time of the gusts along the wind: Dryden's length over the speed"""
    push_x: float = parameter(0.0, unit="N", ge=-20.0, le=20.0, step=0.1)
    """steady force along x_W"""
    push_y: float = parameter(0.0, unit="N", ge=-20.0, le=20.0, step=0.1)
    """steady force along y_W"""
    push_z: float = parameter(0.0, unit="N", ge=-20.0, le=20.0, step=0.1)
    """steady force along z_W"""
    ground_effect: float = parameter(0.0, ge=0.0, le=3.0, step=0.1)
    """ground effect relative to that of one rotor by Cheeseman and Bennett"""
    vibration: float = parameter(0.0, unit="m/s²", ge=0.0, le=20.0, step=0.05)
    """rms of the accelerometer's vibration at hover: lines at each rotor's speed and its blades',
    and broadband"""
    vibration_gyroscope: float = parameter(0.0, unit="°/s", ge=0.0, le=50.0, step=0.5)
    """rms of the gyroscope's vibration at hover, of the same lines"""
    accelerometer_noise: float = parameter(0.05, unit="m/s²", ge=0.0, le=5.0, step=0.01)
    """accelerometer noise per sample"""
    accelerometer_xx: float = _matrix_entry("xx")
    accelerometer_xy: float = _matrix_entry("xy")
    accelerometer_xz: float = _matrix_entry("xz")
    accelerometer_yx: float = _matrix_entry("yx")
    accelerometer_yy: float = _matrix_entry("yy")
    accelerometer_yz: float = _matrix_entry("yz")
    accelerometer_zx: float = _matrix_entry("zx")
    accelerometer_zy: float = _matrix_entry("zy")
    accelerometer_zz: float = _matrix_entry("zz")
    accelerometer_bias_x: float = parameter(0.03, unit="m/s²", ge=-2.0, le=2.0, step=0.01)
    """bias left after calibration"""
    accelerometer_bias_y: float = parameter(-0.02, unit="m/s²", ge=-2.0, le=2.0, step=0.01)
    """bias left after calibration"""
    accelerometer_bias_z: float = parameter(0.04, unit="m/s²", ge=-2.0, le=2.0, step=0.01)
    """bias left after calibration"""
    gyroscope_noise: float = parameter(0.3, unit="°/s", ge=0.0, le=20.0, step=0.05)
    """gyroscope noise per sample"""
    gyroscope_bias_x: float = parameter(0.9, unit="°/s", ge=-20.0, le=20.0, step=0.1)
    """constant drift"""
    gyroscope_bias_y: float = parameter(-0.7, unit="°/s", ge=-20.0, le=20.0, step=0.1)
    """constant drift"""
    gyroscope_bias_z: float = parameter(0.5, unit="°/s", ge=-20.0, le=20.0, step=0.1)
    """constant drift"""
    accelerometer_warm_up: float = parameter(0.0, unit="m/s²", ge=-1.0, le=1.0, step=0.01)
    """change of each accelerometer bias until warm, e-folding in 120 s"""
    gyroscope_warm_up: float = parameter(0.0, unit="°/s", ge=-5.0, le=5.0, step=0.1)
    """change of each gyroscope bias until warm, e-folding in 120 s"""
    lost_samples: float = parameter(0.0, ge=0.0, le=0.5, step=0.001)
    """share of the IMU samples that the microcontroller does not send"""
    ground_pressure: float = parameter(96000.0, unit="Pa", ge=85000.0, le=110000.0, step=10.0)
    """air pressure at z = 0"""
    pressure_noise: float = parameter(2.5, unit="Pa", ge=0.0, le=100.0, step=0.1)
    """barometer noise per sample"""
    ground_stiffness: float = parameter(2000.0, unit="N/m", ge=200.0, le=20000.0, step=100.0)
    """of the landing gear's four feet together"""
    ground_damping: float = parameter(60.0, unit="N s/m", ge=0.0, le=400.0, step=5.0)
    """of the landing gear's four feet together"""
    ground_friction: float = parameter(0.6, ge=0.0, le=2.0, step=0.05)
    """Coulomb friction coefficient of the feet"""
    ground_slope: float = parameter(0.0, unit="°", ge=-20.0, le=20.0, step=1.0)
    """the floor rises along x_W, from the origin on"""
    battery_capacity: float = parameter(2.6, unit="A h", ge=0.1, le=20.0, step=0.1)
    """capacity of the full battery, 4S"""
    battery_charge: float = parameter(1.0, ge=0.0, le=1.0, step=0.05)
    """share of the capacity left at the start, or from the moment it is set"""
    battery_resistance: float = parameter(0.06, unit="ohm", ge=0.0, le=0.5, step=0.01)
    """resistance of cells and cables"""
    command_latency: float = parameter(0.0, unit="s", ge=0.0, le=0.1, step=0.001)
    """delay from a command's arrival at the microcontroller to the motors"""
    radio_delay: float = parameter(0.004, unit="s", ge=0.0, le=0.1, step=0.001)
    """delay of each packet of a simulated Crazyflie's radio, both ways"""
    radio_loss: float = parameter(0.01, ge=0.0, le=0.9, step=0.005)
    """share of these packets that are lost, both ways"""
    unplugged_port: str = parameter("none", choices=("none", "first", "second", "both"))
    """serial port whose adapter is unplugged; plugged in again it is a new device, which the
    vehicle opens at its next start"""
    corrupted_bytes: float = parameter(0.0, ge=0.0, le=0.5, step=0.005)
    """share of corrupted bytes on the serial lines, both ways"""

    held: str = parameter("free", choices=("free", "hand", "bench"))
    """held by a hand, lifted and turned to the hand_* angles, or fixed level on a bench with a
    force/torque sensor; a hand that lets go sets the vehicle down"""
    hand_roll: float = parameter(0.0, unit="°", ge=-180.0, le=180.0, step=5.0)
    """roll angle held by the hand"""
    hand_pitch: float = parameter(0.0, unit="°", ge=-90.0, le=90.0, step=5.0)
    """pitch angle held by the hand"""
    hand_yaw: float = parameter(0.0, unit="°", ge=-180.0, le=180.0, step=5.0)
    """yaw angle held by the hand"""
    bench_sensor: str = parameter("force and speed", choices=("force and speed", "force", "none"))
    """sensors connected at the bench: force/torque, with or without a tachometer"""
    bench_force_noise: float = parameter(0.02, unit="N", ge=0.0, le=1.0, step=0.005)
    """force noise per reading"""
    bench_torque_noise: float = parameter(0.0005, unit="N m", ge=0.0, le=0.1, step=0.0001)
    """torque noise per reading"""
    bench_speed_noise: float = parameter(0.5, unit="count", ge=0.0, le=20.0, step=0.1)
    """tachometer noise per reading, in counts of motor reference"""

    faults: str = parameter("")
    """faults with schedules, like 'barometer.ramp rate=15 from=2; motors.fade motor=left ramp=5'
    (docs/how_to/faults.md)"""

    served: TrackingFaults = TrackingFaults()

    def check_together(self) -> None:
        CATALOGUE.parse(self.faults, self)

    @property
    def accelerometer_matrix(self) -> npt.NDArray[np.float64]:
        """Return T (3, 3) of Sec. 5.2: f_b = T (a_m - b)."""
        return np.array(
            [[getattr(self, f"accelerometer_{row}{column}") for column in "xyz"] for row in "xyz"]
        )

    @property
    def unplugged(self) -> tuple[bool, bool]:
        """Return whether the first and the second serial port's adapter is unplugged."""
        which = self.unplugged_port
        return which in ("first", "both"), which in ("second", "both")
