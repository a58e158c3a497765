"""The true vehicle: its model's quantities with their true values, and what a model leaves out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.parameters import parameter
from quadrotor.vehicle_model import VehicleModel


def _matrix_entry(entry: str) -> float:
    same = entry[0] == entry[1]
    value: float = parameter(
        1.0 if same else 0.0,
        ge=0.5 if same else -0.2,
        le=1.5 if same else 0.2,
        step=0.001,
        description=f"entry {entry} of the true T of Sec. 5.2, what a calibration is to find",
    )
    return value


class SimulatorParameters(VehicleModel):
    """Truth of the simulated vehicle; defaults are the MK-Quadro the flight stack believes in.

    Inherits mass, inertia, geometry and motor law of VehicleModel. Noise is Gaussian, per sample.
    """

    seed: int = parameter(
        1,
        ge=0,
        le=2**31 - 1,
        step=1,
        read_only=True,
        description="of all random numbers; the same seed gives the same bytes",
    )
    imu_rate: int = parameter(
        500,
        unit="Hz",
        ge=60,
        le=1000,
        step=10,
        read_only=True,
        description="IMU samples a second, over both ports, until the vehicle asks for its own "
        "rate; `quadlab fly` asks for this one",
    )
    start_x: float = parameter(
        0.0,
        unit="m",
        ge=-10.0,
        le=10.0,
        step=0.1,
        read_only=True,
        description="where it stands on the floor at the start, in W",
    )
    start_y: float = parameter(
        0.0,
        unit="m",
        ge=-10.0,
        le=10.0,
        step=0.1,
        read_only=True,
        description="where it stands on the floor at the start, in W",
    )
    thrust_efficiency: float = parameter(
        1.0,
        ge=0.5,
        le=1.2,
        step=0.001,
        description="true thrust over the motor law's; 0.938 gives the paper's 1.394 kg (Sec. 7)",
    )
    payload: float = parameter(
        0.0,
        unit="kg",
        ge=0.0,
        le=1.0,
        step=0.05,
        description="mass added at the centre, which the flight stack does not know",
    )
    motor_gain_front: float = parameter(
        1.0, ge=0.5, le=1.2, step=0.01, description="true thrust of this motor over the others'"
    )
    motor_gain_left: float = parameter(
        1.0, ge=0.5, le=1.2, step=0.01, description="true thrust of this motor over the others'"
    )
    motor_gain_rear: float = parameter(
        1.0, ge=0.5, le=1.2, step=0.01, description="true thrust of this motor over the others'"
    )
    motor_gain_right: float = parameter(
        1.0, ge=0.5, le=1.2, step=0.01, description="true thrust of this motor over the others'"
    )
    failed_motor: int = parameter(
        0,
        ge=0,
        le=4,
        step=1,
        description="gives no thrust though it turns: 1 front, 2 left, 3 rear, 4 right; 0 none",
    )
    missing_motor: int = parameter(
        0,
        ge=0,
        le=4,
        step=1,
        description="its controller does not answer on the motors' bus; numbers as above",
    )
    drag: float = parameter(
        0.0,
        unit="N s/m",
        ge=0.0,
        le=2.0,
        step=0.01,
        description="linear drag of the whole vehicle, against its velocity through the air",
    )
    wind_x: float = parameter(
        0.0,
        unit="m/s",
        ge=-15.0,
        le=15.0,
        step=0.1,
        description="steady wind along x_W; acts by the drag",
    )
    wind_y: float = parameter(
        0.0,
        unit="m/s",
        ge=-15.0,
        le=15.0,
        step=0.1,
        description="steady wind along y_W; acts by the drag",
    )
    wind_z: float = parameter(
        0.0,
        unit="m/s",
        ge=-15.0,
        le=15.0,
        step=0.1,
        description="steady wind along z_W; acts by the drag",
    )
    gust: float = parameter(
        0.0,
        unit="m/s",
        ge=0.0,
        le=10.0,
        step=0.1,
        description="standard deviation of the wind about the steady one, an axis",
    )
    gust_time: float = parameter(
        1.0, unit="s", ge=0.05, le=20.0, step=0.05, description="correlation time of the gusts"
    )
    push_x: float = parameter(
        0.0, unit="N", ge=-20.0, le=20.0, step=0.1, description="steady force along x_W"
    )
    push_y: float = parameter(
        0.0, unit="N", ge=-20.0, le=20.0, step=0.1, description="steady force along y_W"
    )
    push_z: float = parameter(
        0.0, unit="N", ge=-20.0, le=20.0, step=0.1, description="steady force along z_W"
    )
    ground_effect: float = parameter(
        0.0,
        ge=0.0,
        le=3.0,
        step=0.1,
        description="gain of thrust near the ground over Cheeseman and Bennett's for one rotor",
    )
    vibration: float = parameter(
        0.0,
        unit="m/s²",
        ge=0.0,
        le=20.0,
        step=0.1,
        description="the accelerometer's further deviation at hover speed, from the rotors",
    )
    vibration_gyroscope: float = parameter(
        0.0,
        unit="deg/s",
        ge=0.0,
        le=50.0,
        step=0.5,
        description="the gyroscope's further deviation at hover speed, from the rotors",
    )
    accelerometer_noise: float = parameter(
        0.05, unit="m/s²", ge=0.0, le=5.0, step=0.01, description="standard deviation a sample"
    )
    accelerometer_xx: float = _matrix_entry("xx")
    accelerometer_xy: float = _matrix_entry("xy")
    accelerometer_xz: float = _matrix_entry("xz")
    accelerometer_yx: float = _matrix_entry("yx")
    accelerometer_yy: float = _matrix_entry("yy")
    accelerometer_yz: float = _matrix_entry("yz")
    accelerometer_zx: float = _matrix_entry("zx")
    accelerometer_zy: float = _matrix_entry("zy")
    accelerometer_zz: float = _matrix_entry("zz")
    accelerometer_bias_x: float = parameter(
        0.03, unit="m/s²", ge=-2.0, le=2.0, step=0.01, description="left after calibration"
    )
    accelerometer_bias_y: float = parameter(
        -0.02, unit="m/s²", ge=-2.0, le=2.0, step=0.01, description="left after calibration"
    )
    accelerometer_bias_z: float = parameter(
        0.04, unit="m/s²", ge=-2.0, le=2.0, step=0.01, description="left after calibration"
    )
    gyroscope_noise: float = parameter(
        0.3, unit="deg/s", ge=0.0, le=20.0, step=0.05, description="standard deviation a sample"
    )
    gyroscope_bias_x: float = parameter(
        0.9, unit="deg/s", ge=-20.0, le=20.0, step=0.1, description="constant drift"
    )
    gyroscope_bias_y: float = parameter(
        -0.7, unit="deg/s", ge=-20.0, le=20.0, step=0.1, description="constant drift"
    )
    gyroscope_bias_z: float = parameter(
        0.5, unit="deg/s", ge=-20.0, le=20.0, step=0.1, description="constant drift"
    )
    ground_pressure: float = parameter(
        96_000.0,
        unit="Pa",
        ge=85_000.0,
        le=110_000.0,
        step=10.0,
        description="air pressure at z = 0",
    )
    pressure_noise: float = parameter(
        2.5, unit="Pa", ge=0.0, le=100.0, step=0.1, description="standard deviation a sample"
    )
    ground_stiffness: float = parameter(
        2000.0,
        unit="N/m",
        ge=200.0,
        le=20_000.0,
        step=100.0,
        description="of the landing gear's four feet together",
    )
    ground_damping: float = parameter(
        60.0,
        unit="N s/m",
        ge=0.0,
        le=400.0,
        step=5.0,
        description="of the landing gear's four feet together",
    )
    ground_friction: float = parameter(
        0.6, ge=0.0, le=2.0, step=0.05, description="Coulomb coefficient of the feet"
    )
    battery_capacity: float = parameter(
        2.6, unit="A h", ge=0.1, le=20.0, step=0.1, description="of the full battery, 4S"
    )
    battery_charge: float = parameter(
        1.0,
        ge=0.0,
        le=1.0,
        step=0.05,
        description="share of the capacity left at the start; set later, left from then on",
    )
    battery_resistance: float = parameter(
        0.06, unit="ohm", ge=0.0, le=0.5, step=0.01, description="inner resistance and cables"
    )
    command_latency: float = parameter(
        0.0,
        unit="s",
        ge=0.0,
        le=0.1,
        step=0.001,
        description="from a command's arrival at the microcontroller to its acting on the motors",
    )
    unplugged_port: str = parameter(
        "none",
        choices=("none", "first", "second", "both"),
        description="serial port whose adapter is pulled out; plugged in again it is a new device, "
        "which the vehicle opens at its next start",
    )
    corrupted_bytes: float = parameter(
        0.0,
        ge=0.0,
        le=0.5,
        step=0.005,
        description="share of the bytes on the serial wires that arrive as others, both ways",
    )

    held: str = parameter(
        "free",
        choices=("free", "hand", "bench"),
        description="by a hand, lifted and turned as hand_* say; or fixed level on a bench, with "
        "a force/torque sensor under the turning motor. Let go by the hand it is set down",
    )
    hand_roll: float = parameter(
        0.0, unit="deg", ge=-180.0, le=180.0, step=5.0, description="the hand turns it there"
    )
    hand_pitch: float = parameter(
        0.0, unit="deg", ge=-90.0, le=90.0, step=5.0, description="the hand turns it there"
    )
    hand_yaw: float = parameter(
        0.0, unit="deg", ge=-180.0, le=180.0, step=5.0, description="the hand turns it there"
    )
    bench_sensor: str = parameter(
        "force and speed",
        choices=("force and speed", "force", "none"),
        description="what is plugged in at the bench: a tachometer beside the force/torque sensor",
    )
    bench_force_noise: float = parameter(
        0.02, unit="N", ge=0.0, le=1.0, step=0.005, description="standard deviation a reading"
    )
    bench_torque_noise: float = parameter(
        0.0005, unit="N m", ge=0.0, le=0.1, step=0.0001, description="standard deviation a reading"
    )
    bench_speed_noise: float = parameter(
        0.5,
        unit="count",
        ge=0.0,
        le=20.0,
        step=0.1,
        description="standard deviation a reading, as a motor reference",
    )

    @property
    def accelerometer_matrix(self) -> npt.NDArray[np.float64]:
        """Return t (3, 3) of Sec. 5.2: f_b = T (a_m - b)."""
        return np.array(
            [[getattr(self, f"accelerometer_{row}{column}") for column in "xyz"] for row in "xyz"]
        )

    @property
    def unplugged(self) -> tuple[bool, bool]:
        """Return whether the first and the second serial port's adapter is pulled out."""
        which = self.unplugged_port
        return which in ("first", "both"), which in ("second", "both")
