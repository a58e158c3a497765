"""All parameters of one vehicle: the tree behind `--set`, the sliders and the log."""

from __future__ import annotations

from collections.abc import Mapping

from bearing_sim.beacons import parse_layout
from control.behaviors.parameters import BehaviorParameters
from control.parameters import ControlParameters
from estimation.mass_estimator import MassParameters
from estimation.parameters import EstimationParameters
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.parameters import Parameters, ParameterValue, parameter
from quadrotor.vehicle_model import VehicleModel
from vehicle.imu_calibration import ImuCalibration


class SafetyParameters(Parameters):
    """Thresholds and reactions of the supervisor; the table is docs/safety.md."""

    link_timeout: float = parameter(
        0.4, unit="s", ge=0.1, le=2.0, step=0.05,
        description="silence of the station after which a flying vehicle brakes",
    )  # fmt: skip
    link_land_after: float = parameter(
        2.0, unit="s", ge=0.0, le=60.0, step=0.5,
        description="time from braking for a lost link to landing",
    )  # fmt: skip
    pose_land_after: float = parameter(
        1.0, unit="s", ge=0.1, le=5.0, step=0.1,
        description="time without a pose measurement after which the vehicle lands on its IMU",
    )  # fmt: skip
    battery_warning: float = parameter(
        13.8, unit="V", ge=12.0, le=16.8, step=0.1,
        description="battery voltage below which a warning is given and arming is refused",
    )  # fmt: skip
    battery_land: float = parameter(
        13.1, unit="V", ge=12.0, le=16.8, step=0.1,
        description="battery voltage below which the vehicle lands",
    )  # fmt: skip
    battery_delay: float = parameter(
        1.0, unit="s", ge=0.1, le=10.0, step=0.1,
        description="time the voltage must stay below a limit before it counts",
    )  # fmt: skip
    tilt_cut: float = parameter(
        100.0, unit="deg", ge=60.0, le=180.0, step=5.0,
        description="tilt at which the motors are stopped: the vehicle has turned over",
    )  # fmt: skip
    arm_tilt_max: float = parameter(
        15.0, unit="deg", ge=2.0, le=45.0, step=1.0,
        description="largest tilt at which the vehicle may be armed",
    )  # fmt: skip
    disarm_after_landing: float = parameter(
        1.0, unit="s", ge=0.0, le=30.0, step=0.5,
        description="time from touch-down to motors off",
    )  # fmt: skip
    landing_support: float = parameter(
        0.1, ge=0.05, le=1.0, step=0.01,
        description="touch-down: share by which the lift exceeds what the thrust gives in the air",
    )  # fmt: skip
    gyro_samples: int = parameter(
        500, ge=50, le=5000, step=50,
        description="still gyroscope samples averaged at each start (Sec. 5.1)",
    )  # fmt: skip
    gyro_deviation_max: float = parameter(
        1.0, unit="deg/s", ge=0.1, le=10.0, step=0.1,
        description="standard deviation above which the vehicle was not still",
    )  # fmt: skip


class BeaconParameters(Parameters):
    """Where the beacons stand, and where their bearings are good enough to fly on."""

    layout: str = parameter(
        "paper",
        description="a preset (paper, wide, eight, ceiling, wall) or 'id x y z; id x y z; ...' "
        "in m; not changed while bearings are flown on",
    )  # fmt: skip
    envelope_xy: float = parameter(
        1.5, unit="m", ge=0.2, le=20.0, step=0.1,
        description="bearings are flown on within this of the origin in x and in y",
    )  # fmt: skip
    envelope_z_max: float = parameter(
        2.0, unit="m", ge=0.4, le=20.0, step=0.1,
        description="highest flight on bearings",
    )  # fmt: skip
    height_min: float = parameter(
        0.3, unit="m", ge=0.1, le=2.0, step=0.05,
        description="lowest flight on bearings, above take-off",
    )  # fmt: skip


class FallBackParameters(Parameters):
    """When bearings are no longer flown on; the table is docs/safety.md."""

    enabled: bool = parameter(
        True,
        description="fall back to the tracker, or land without it, by the bounds below; "
        "false also takes bearings that the gate would reject",
    )
    window: float = parameter(
        1.0, unit="s", ge=0.2, le=5.0, step=0.1,
        description="time over which innovations are judged",
    )  # fmt: skip
    gate: float = parameter(
        5.0, ge=2.0, le=20.0, step=0.5,
        description="standard deviations beyond which a bearing counts as rejected",
    )  # fmt: skip
    rejected_max: float = parameter(
        0.3, ge=0.05, le=1.0, step=0.05,
        description="largest share of rejected bearings",
    )  # fmt: skip
    consistency_max: float = parameter(
        3.0, ge=1.2, le=20.0, step=0.1,
        description="largest mean square of the other bearings' normalised innovations",
    )  # fmt: skip
    age_max: float = parameter(
        0.5, unit="s", ge=0.1, le=5.0, step=0.05,
        description="longest time without a frame applied",
    )  # fmt: skip
    position_deviation_max: float = parameter(
        0.3, unit="m", ge=0.02, le=5.0, step=0.01,
        description="largest deviation of position by the estimator's own covariance",
    )  # fmt: skip
    attitude_deviation_max: float = parameter(
        6.0, unit="deg", ge=0.2, le=45.0, step=0.5,
        description="the same of attitude",
    )  # fmt: skip
    disagreement_max: float = parameter(
        0.3, unit="m", ge=0.05, le=5.0, step=0.05,
        description="largest distance from the estimate that the tracker's poses give",
    )  # fmt: skip
    disagreement_attitude_max: float = parameter(
        5.0, unit="deg", ge=1.0, le=90.0, step=1.0,
        description="the same of attitude",
    )  # fmt: skip


class VehicleParameters(Parameters):
    """The vehicle's own tree; the vehicle is the authority for every value in it."""

    model: VehicleModel = VehicleModel()
    control: ControlParameters = ControlParameters()
    estimation: EstimationParameters = EstimationParameters()
    beacons: BeaconParameters = BeaconParameters()
    fallback: FallBackParameters = FallBackParameters()
    mass: MassParameters = MassParameters()
    behavior: BehaviorParameters = BehaviorParameters()
    safety: SafetyParameters = SafetyParameters()
    imu: ImuCalibration = ImuCalibration()


ORDERED = (
    ("behavior.volume_x_min", "behavior.volume_x_max"),
    ("behavior.volume_y_min", "behavior.volume_y_max"),
    ("behavior.volume_z_min", "behavior.volume_z_max"),
    ("model.motor_reference_min", "model.motor_reference_max"),
    ("mass.mass_min", "mass.mass_max"),
    ("safety.battery_land", "safety.battery_warning"),
)
"""Pairs whose first must stay below the second."""


def check_pairs(values: Mapping[str, ParameterValue]) -> None:
    """What no single value shows: pairs out of order, a layout that is none.

    Args:
        values: all of them.

    Raises OutOfBoundsError that names the parameters.
    """
    for low, high in ORDERED:
        if not float(values[low]) < float(values[high]):
            raise OutOfBoundsError(
                f"{low} = {values[low]} is not below {high} = {values[high]}; "
                "change the other one first, or both at once"
            )
    try:
        parse_layout(str(values["beacons.layout"]))
    except MeasurementError as error:
        raise OutOfBoundsError(f"beacons.layout: {error}") from None


def new_parameters() -> VehicleParameters:
    """A fresh tree of defaults, sharing nothing with any other."""
    return VehicleParameters().model_copy(deep=True)
