"""The parameters of one vehicle: the tree behind `--set`, the sliders and the log."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from bearing_sim.beacons import parse_layout
from control.behaviors.parameters import BehaviorParameters
from control.keep_out import parse_keep_out
from control.laws import new_control_parameters
from control.parameters import ControlParameters
from estimation.parameters import EstimationParameters
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter
from quadrotor.vehicle_model import GRAVITY, VehicleModel, thrust_of_reference
from vehicle.boards.imu import ImuCalibration
from vehicle.boards.offered import offered
from vehicle.flight_parameters import FlownMassParameters, NearHoveringParameters
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle.plugins import declared
from vehicle.safety.parameters import SafetyParameters


class BeaconParameters(Parameters):
    """The beacons' positions, and where their bearings are good enough to fly on."""

    layout: str = parameter("paper")
    """a preset (paper, wide, eight, ceiling, wall) or 'id x y z; id x y z; ...' in m; not changed
    while bearings are flown on"""
    envelope_xy: float = parameter(1.5, unit="m", ge=0.2, le=20.0, step=0.1)
    """bearings are flown on within this of the origin in x and in y"""
    envelope_z_max: float = parameter(2.0, unit="m", ge=0.4, le=20.0, step=0.1)
    """highest flight on bearings"""
    height_min: float = parameter(0.3, unit="m", ge=0.1, le=2.0, step=0.05)
    """lowest flight on bearings, above take-off"""


class FallBackParameters(Parameters):
    """The conditions under which bearings are no longer flown on; the table is docs/safety.md."""

    enabled: bool = parameter(True)
    """fall back to the tracker, or land without it, by the bounds below; false also takes bearings
    that the gate would reject"""
    window: float = parameter(1.0, unit="s", ge=0.2, le=5.0, step=0.1)
    """time over which innovations are judged"""
    gate: float = parameter(5.0, ge=2.0, le=20.0, step=0.5)
    """standard deviations beyond which a bearing counts as rejected"""
    rejected_max: float = parameter(0.3, ge=0.05, le=1.0, step=0.05)
    """largest share of rejected bearings"""
    consistency_max: float = parameter(3.0, ge=1.2, le=20.0, step=0.1)
    """largest mean square of the other bearings' normalised innovations"""
    age_max: float = parameter(0.5, unit="s", ge=0.1, le=5.0, step=0.05)
    """longest time without a frame applied"""
    position_deviation_max: float = parameter(0.3, unit="m", ge=0.02, le=5.0, step=0.01)
    """largest deviation of position by the estimator's own covariance"""
    attitude_deviation_max: float = parameter(6.0, unit="°", ge=0.2, le=45.0, step=0.5)
    """the same of attitude"""
    disagreement_max: float = parameter(0.3, unit="m", ge=0.05, le=5.0, step=0.05)
    """largest distance from the estimate that the tracker's poses give"""
    disagreement_attitude_max: float = parameter(5.0, unit="°", ge=1.0, le=90.0, step=1.0)
    """the same of attitude"""
    beacon_window: float = parameter(2.0, unit="s", ge=0.5, le=20.0, step=0.5)
    """time over which the residuals of each beacon are averaged"""
    beacon_offset_max: float = parameter(1.5, unit="°", ge=0.2, le=20.0, step=0.1)
    """largest mean offset of one beacon's bearings from what the others expect"""
    exclude_beacon: bool = parameter(False)
    """leave out a beacon whose bearings are off, as long as it is known which and the estimator has
    enough others"""


class VehicleParameters(Parameters):
    """The vehicle's own tree; the vehicle is the authority for every value in it."""

    model: VehicleModel = VehicleModel()
    control: ControlParameters = Field(default_factory=new_control_parameters)
    estimation: EstimationParameters = EstimationParameters()
    beacons: BeaconParameters = BeaconParameters()
    fallback: FallBackParameters = FallBackParameters()
    mass: FlownMassParameters = FlownMassParameters()
    behavior: BehaviorParameters = BehaviorParameters()
    near_hovering: NearHoveringParameters = NearHoveringParameters()
    safety: SafetyParameters = SafetyParameters()
    imu: ImuCalibration = ImuCalibration()
    log: OnboardLogParameters = OnboardLogParameters()
    plugins: Parameters = Field(default_factory=declared.offered)
    board: Parameters = Field(default_factory=offered)


ORDERED = (
    ("behavior.volume_x_min", "behavior.volume_x_max"),
    ("behavior.volume_y_min", "behavior.volume_y_max"),
    ("behavior.volume_z_min", "behavior.volume_z_max"),
    ("model.motor_reference_min", "model.motor_reference_max"),
    ("mass.mass_min", "mass.mass_max"),
    ("log.stop_free", "log.keep_free"),
    ("safety.battery_land", "safety.battery_warning"),
    ("safety.tilt_max", "safety.tilt_cut"),
)
"""Pairs of parameters whose first must stay below the second."""


def check_pairs(values: Mapping[str, ParameterValue]) -> None:
    """Check what no single value shows: pairs out of order, and an invalid layout or
    keep-out box.

    Args:
        values: the values of all parameters.

    Raises OutOfBoundsError that names the parameters.
    """
    for low, high in ORDERED:
        if not float(values[low]) < float(values[high]):
            raise OutOfBoundsError(
                f"{low} = {values[low]} is not below {high} = {values[high]}; "
                "change the other one first, or both at once"
            )
    parse_keep_out(str(values["behavior.keep_out"]))
    try:
        parse_layout(str(values["beacons.layout"]))
    except MeasurementError as error:
        raise OutOfBoundsError(f"beacons.layout: {error}") from None


def check_hover(values: Mapping[str, ParameterValue]) -> None:
    """Check that the motors of the model can carry its weight, by the values of all parameters.

    Raises OutOfBoundsError.
    """
    slope, offset = float(values["model.motor_slope"]), float(values["model.motor_offset"])
    low, high = (
        thrust_of_reference(float(values[f"model.motor_reference_{end}"]), slope, offset)
        for end in ("min", "max")
    )
    mass = float(values["model.mass"])
    share = 0.25 * GRAVITY * mass
    if not low < share < high:
        raise OutOfBoundsError(
            f"model.mass = {mass:g} kg cannot hover: each motor would carry {share:.3g} N and "
            f"gives {low:.3g} to {high:.3g} N; change the motors' law first, or both at once"
        )


def new_parameters() -> VehicleParameters:
    """Return a new tree of defaults that shares nothing with another."""
    return VehicleParameters().model_copy(deep=True)
