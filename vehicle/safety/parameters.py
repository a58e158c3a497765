"""The thresholds and reactions of the supervisor."""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter

REACTIONS = ("none", "brake", "land", "descend", "emergency", "cut")
"""Names of vehicle.safety.supervisor.Reaction, in lower case."""


OSCILLATION_REACTIONS = ("warn", "restore", "brake")


def _reaction(default: str, description: str) -> str:
    chosen: str = parameter(default, choices=REACTIONS, description=description)
    return chosen


class SafetyParameters(Parameters):
    """Thresholds and reactions of the supervisor; the table is docs/safety.md."""

    link_timeout: float = parameter(0.4, unit="s", ge=0.1, le=2.0, step=0.05)
    """time without a heartbeat from the station after which the vehicle reacts"""
    link_reaction: str = _reaction("brake", "reaction to a lost link")
    link_land_after: float = parameter(2.0, unit="s", ge=0.0, le=60.0, step=0.5)
    """time from link_reaction to link_land_reaction"""
    link_land_reaction: str = _reaction("land", "reaction when the link stays lost")
    pose_land_after: float = parameter(1.0, unit="s", ge=0.1, le=5.0, step=0.1)
    """time without a pose measurement after which the vehicle reacts"""
    pose_reaction: str = _reaction("descend", "reaction to missing poses")
    battery_warning: float = parameter(13.8, unit="V", ge=2.5, le=16.8, step=0.1)
    """battery voltage below which the vehicle warns and refuses to arm"""
    battery_land: float = parameter(13.1, unit="V", ge=2.5, le=16.8, step=0.1)
    """battery voltage below which the vehicle reacts"""
    battery_delay: float = parameter(1.0, unit="s", ge=0.1, le=10.0, step=0.1)
    """time the voltage must stay below a limit before it counts"""
    battery_reaction: str = _reaction("emergency", "reaction to a voltage below battery_land")
    tilt_cut: float = parameter(100.0, unit="°", ge=60.0, le=180.0, step=5.0)
    """tilt above which the vehicle has turned over"""
    tilt_cut_reaction: str = _reaction("cut", "reaction to a tilt above tilt_cut")
    arm_tilt_max: float = parameter(15.0, unit="°", ge=2.0, le=45.0, step=1.0)
    """largest tilt at which the vehicle may be armed"""
    tracker_check: bool = parameter(True)
    """poses that contradict gyroscope or accelerometer (reversed or permuted axes) count as
    missing"""
    inertial_reaction: str = _reaction(
        "land", "reaction to an IMU that tracker and motors contradict"
    )
    tracker_tilt_told: float = parameter(1.2, unit="°", ge=0.5, le=45.0, step=0.1)
    """angle between the verticals of tracker and accelerometer that is reported"""
    tracker_tilt_max: float = parameter(5.0, unit="°", ge=1.0, le=45.0, step=0.5)
    """largest such angle at which the vehicle may be armed"""
    tracker_stamps_told: float = parameter(0.02, unit="s", ge=0.005, le=1.0, step=0.005)
    """error of the poses' stamps, by the gyroscope, that is reported"""
    tracker_scale_told: float = parameter(4.0, unit="%", ge=1.0, le=100.0, step=0.5)
    """error of the positions' scale, by the accelerometer, that is reported"""
    disarm_after_landing: float = parameter(1.0, unit="s", ge=0.0, le=30.0, step=0.5)
    """time from touch-down to motors off"""
    landing_support: float = parameter(0.1, ge=0.05, le=1.0, step=0.01)
    """touch-down: share by which the lift exceeds what the thrust gives in the air"""
    tilt_max: float = parameter(70.0, unit="°", ge=20.0, le=150.0, step=5.0)
    """tilt that no manoeuvre needs"""
    tilt_delay: float = parameter(0.2, unit="s", ge=0.0, le=2.0, step=0.05)
    """time it must last"""
    tilt_reaction: str = _reaction("emergency", "reaction to excessive tilt")
    innovation_max: float = parameter(0.5, unit="m", ge=0.05, le=10.0, step=0.05)
    """distance of poses from their prediction beyond which the estimate diverged"""
    innovation_delay: float = parameter(0.3, unit="s", ge=0.0, le=5.0, step=0.05)
    """time it must last"""
    innovation_reaction: str = _reaction("descend", "reaction to a diverged estimate")
    volume_margin: float = parameter(0.5, unit="m", ge=0.05, le=20.0, step=0.05)
    """largest distance outside the flight volume before the vehicle reacts"""
    volume_delay: float = parameter(0.2, unit="s", ge=0.0, le=5.0, step=0.05)
    """time it must last"""
    volume_reaction: str = _reaction("land", "reaction outside the flight volume or in a box")
    speed_max: float = parameter(6.0, unit="m/s", ge=0.5, le=30.0, step=0.5)
    """speed that is too high"""
    speed_delay: float = parameter(0.2, unit="s", ge=0.0, le=5.0, step=0.05)
    """time it must last"""
    speed_reaction: str = _reaction("brake", "reaction to excessive speed")
    saturation_delay: float = parameter(1.0, unit="s", ge=0.1, le=10.0, step=0.1)
    """longest time for which motors may be saturated continuously"""
    saturation_reaction: str = _reaction("land", "reaction to saturated motors")
    port_reaction: str = _reaction("land", "reaction to a lost serial port")
    oscillation_reaction: str = parameter("warn", choices=OSCILLATION_REACTIONS)
    """reaction to an oscillation: warn only; restore what a person changed last in this flight; or
    brake"""
    command_timeout: float = parameter(0.25, unit="s", ge=0.05, le=2.0, step=0.05)
    """time without commands after which the microcontroller lands on its own"""
    emergency_land: str = parameter("emergency", choices=("land", "descend", "emergency"))
    """action of Emergency land: land under control, descend without a pose, or leave the landing to
    the microcontroller"""
    bench_timeout: float = parameter(0.5, unit="s", ge=0.1, le=5.0, step=0.1)
    """time after which a motor on the bench stops unless it is requested again"""
    bench_turn_max: float = parameter(20.0, unit="°", ge=5.0, le=90.0, step=5.0)
    """turn of the vehicle within about a second that stops a motor on the bench, because the
    vehicle is not fixed"""
    gyro_samples: int = parameter(500, ge=50, le=5000, step=50)
    """still gyroscope samples averaged at each start (Sec. 5.1)"""
    gyro_deviation_max: float = parameter(1.0, unit="°/s", ge=0.1, le=10.0, step=0.1)
    """standard deviation above which the vehicle counts as moving"""
    gyro_drift_max: float = parameter(40.0, unit="°/s", ge=1.0, le=300.0, step=1.0)
    """largest plausible gyroscope drift; above it the vehicle was turning steadily"""
    gyro_change_max: float = parameter(5.0, unit="°/s", ge=0.1, le=300.0, step=0.1)
    """largest plausible change of the gyroscope drift in a new calibration"""
