"""Parameters of the complementary filter, its gate, their presets and their compiled record.

Bandwidths (rad/s) are the filter's poles: eq. 11's gains K_p, K_v of a double pole are 2 omega and
omega^2, so the printed 126.3 and 3987.3 are a double pole at 63.15 rad/s. `estimation.gains`
converts gains as printed, or per measurement, to parameters.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.error_state_parameters import DEGREES, ERROR_STATE_NOISE, ErrorStateParameters
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Record, has_attitude, pose_sample
from quadrotor.tracked_body import TrackedBody

ESTIMATION_GAINS = np.dtype(
    [
        ("position_bandwidth", "f8"),  # rad/s
        ("accelerometer_bias_bandwidth", "f8"),  # rad/s
        ("attitude_bandwidth", "f8"),  # rad/s
        ("gyroscope_bias_bandwidth", "f8"),  # rad/s
        ("rate_low_pass", "f8"),  # Hz
        ("rate_notch", "f8"),  # Hz
        ("rate_notch_width", "f8"),  # Hz
        ("norm_penalty", "f8"),  # 1/s
        ("accelerometer_bias_limit", "f8"),  # m/s^2
        ("gyroscope_bias_limit", "f8"),  # rad/s
        ("pose_gate", "f8"),  # standard deviations
        ("pose_position_noise", "f8"),  # m
        ("pose_attitude_noise", "f8"),  # rad
    ],
    align=True,
)


class TrackerCalibration(TrackedBody):
    """The tracker's calibration, found by the experiments `tracker_delay` and `tracker_body`."""

    delay: float = parameter(0.0, unit="s", ge=-0.1, le=0.15, step=0.001, flight_step=0.01)
    """by which the tracker's poses are stamped too late; taken off their stamps"""

    def measured(self, pose: Record) -> Record:
        """Return the vehicle's POSE_SAMPLE (1,) from that of the tracked body."""
        if self.delay == 0.0 and self.is_vehicle:
            return pose
        position_w, quaternion_wb = pose["position_w"][0], pose["quaternion_wb"][0]
        if has_attitude(quaternion_wb):  # a single marker is only corrected for delay
            position_w, quaternion_wb = self.vehicle(position_w, quaternion_wb)
        stamp_ns = pose["stamp_ns"].item() - round(1e9 * self.delay)
        return pose_sample(stamp_ns, position_w, quaternion_wb)


class PluginParameters(Parameters):
    """The built-in estimator beneath one of the user's own, and how far from it that may be."""

    built_in: str = parameter("complementary", choices=("complementary", "error_state"))
    """estimator that runs beneath a plugin, is its start and takes over when it fails; on
    bearings or positions of a single marker choose error_state"""
    position_max: float = parameter(0.25, unit="m", ge=0.02, le=5.0, step=0.01)
    """largest distance of a flown plugin's position from the built-in estimator's"""
    velocity_max: float = parameter(0.5, unit="m/s", ge=0.05, le=10.0, step=0.05)
    """largest difference of its velocity from the built-in estimator's"""
    attitude_max: float = parameter(10.0, unit="°", ge=1.0, le=90.0, step=0.5)
    """largest angle between its attitude and the built-in estimator's"""
    udp_peer: str = parameter("127.0.0.1:9103")
    """ADDRESS:PORT (IPv4) of the program that is the estimator `udp`"""
    udp_port: int = parameter(9104, ge=1024, le=65535)
    """port of the vehicle that it answers to"""


NO_SENSORS = "none"


class EstimationParameters(Parameters):
    """The choice of estimator and source; gains of eqs. 11 and 12 as poles, for a 100
    Hz tracker.
    """

    estimator: str = parameter("complementary", choices=("complementary", "error_state"))
    """what the vehicle flies on: built in, a plugin (a file written since the start is listed after
    the next start), or udp (a program that answers over UDP); in flight choose the shadow alone"""
    shadow: str = parameter("none", choices=("none", "complementary", "error_state"))
    """second estimator, run in parallel, for comparison or to take over"""
    shadow_source: str = parameter("same", choices=("same", "poses", "bearings", "both"))
    """measurements of the shadow; on bearings it may be handed over to in flight"""
    rescue: bool = parameter(True)
    """a shadow on the same measurements takes over from an error-state filter that is inconsistent
    and hands back; on poses the complementary one runs next to it for that"""
    source: str = parameter("poses", choices=("poses", "bearings", "both"))
    """measurements used: the tracker's poses, bearings to beacons, or both"""
    sensors: str = parameter(NO_SENSORS)
    """sensors of your own that correct error_state as well (docs/extending/plugins.md): files of
    plugins or of packages, separated by spaces; one is added on the ground only"""

    position_bandwidth: float = parameter(8.0, unit="rad/s", ge=0.5, le=200.0, step=0.1)
    """double pole of position and velocity, eq. 11 (the paper's gains: 63.15)"""
    accelerometer_bias_bandwidth: float = parameter(0.3, unit="rad/s", ge=0.0, le=10.0, step=0.05)
    """pole of the accelerometer bias; 0 holds the bias"""
    attitude_bandwidth: float = parameter(3.0, unit="rad/s", ge=0.05, le=200.0, step=0.1)
    """K_est,q of eq. 12 (the paper's: 62.8)"""
    gyroscope_bias_bandwidth: float = parameter(0.2, unit="rad/s", ge=0.0, le=10.0, step=0.05)
    """pole of the gyroscope bias; 0 holds the bias, as the paper does"""
    rate_low_pass: float = parameter(150.0, unit="Hz", ge=1.0, le=1000.0, step=1.0)
    """cut-off of the angular velocity's low-pass"""
    rate_notch: float = parameter(0.0, unit="Hz", ge=0.0, le=400.0, step=1.0)
    """frequency taken out of the angular velocity, as the rotors'; 0: none"""
    rate_notch_width: float = parameter(20.0, unit="Hz", ge=2.0, le=100.0, step=1.0)
    """width of that notch at half power; it delays by width/(2π notch²)"""
    norm_penalty: float = parameter(10.0, unit="1/s", ge=0.0, le=1000.0, step=1.0)
    """pull of the estimated quaternion to unit length, lambda under eq. 12"""
    measurement_timeout: float = parameter(0.1, unit="s", ge=0.02, le=1.0, step=0.01)
    """age of the newest pose above which the estimate counts as predicted only"""
    accelerometer_bias_limit: float = parameter(1.0, unit="m/s²", ge=0.0, le=5.0, step=0.1)
    """clamp of each component of the accelerometer bias"""
    gyroscope_bias_limit: float = parameter(0.05, unit="rad/s", ge=0.0, le=0.5, step=0.01)
    """clamp of each component of the gyroscope bias"""
    pose_gate: float = parameter(6.0, ge=3.0, le=1000.0, step=0.5)
    """deviations of its innovation beyond which a pose is refused; 1000: never"""
    pose_position_noise: float = parameter(0.01, unit="m", ge=0.001, le=0.5, step=0.001)
    """least deviation the gate takes for a position on each axis, errors of time included"""
    pose_attitude_noise: float = parameter(1.0, unit="°", ge=0.1, le=20.0, step=0.1)
    """least deviation the gate takes for an attitude on each axis"""
    tracker: TrackerCalibration = TrackerCalibration()
    error_state: ErrorStateParameters = ErrorStateParameters()
    plugin: PluginParameters = PluginParameters()


PRESETS: dict[str, dict[str, float]] = {
    # As printed: no bias state, made for tracking at 100 Hz or more.
    "paper": {
        "position_bandwidth": 63.15,
        "attitude_bandwidth": 62.8,
        "accelerometer_bias_bandwidth": 0.0,
        "gyroscope_bias_bandwidth": 0.0,
    },
    # Retuned for one-frame poses of bearings (30 Hz, 1.5 deg), which are 100 times noisier.
    "bearings": {
        "position_bandwidth": 2.5,
        "attitude_bandwidth": 0.4,
        "accelerometer_bias_bandwidth": 0.15,
        "gyroscope_bias_bandwidth": 0.08,
    },
    # For bearings applied by the filter itself, which solves the position again at its own
    # attitude: found by search on flights of benchmarks/estimation/flights.py, with other seeds
    # than reported.
    "resolved": {
        "position_bandwidth": 1.8,
        "attitude_bandwidth": 0.2,
        "accelerometer_bias_bandwidth": 0.8,
        "gyroscope_bias_bandwidth": 0.09,
    },
}
"""Named gain sets: `EstimationParameters(**PRESETS["paper"])`."""


def estimation_record(parameters: EstimationParameters) -> Record:
    """Return the gains as one ESTIMATION_GAINS record, shape (1,)."""
    out = np.zeros(1, ESTIMATION_GAINS)
    for name in ESTIMATION_GAINS.names or ():
        out[name] = getattr(parameters, name)
    out["pose_attitude_noise"] = math.radians(parameters.pose_attitude_noise)
    return out


def noise_record(parameters: EstimationParameters) -> Record:
    """Return the noise that the error-state filter assumes, as one ERROR_STATE_NOISE record, shape
    (1,), in SI units.
    """
    out = np.zeros(1, ERROR_STATE_NOISE)
    own = ErrorStateParameters.model_fields
    for name in ERROR_STATE_NOISE.names or ():
        unit = math.radians(1.0) if name in DEGREES else 1.0
        out[name] = unit * getattr(parameters.error_state if name in own else parameters, name)
    return out
