"""The parameters of the laws: `control.NAME.FIELD`.

Position and attitude gains that a law shares with the paper's are those of the paper's law,
`control.position` and `control.attitude`, so that laws are compared at equal stiffness.
"""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter


class PidCascadeParameters(Parameters):
    """Gains of the cascade, as PX4 names them, per unit mass and inertia."""

    position_p_xy: float = parameter(1.4, unit="1/s", ge=0.0, le=5.0, step=0.05, flight_step=1.0)
    """from the position error to the velocity, horizontal"""
    position_p_z: float = parameter(2.0, unit="1/s", ge=0.0, le=5.0, step=0.05, flight_step=1.0)
    """from the position error to the velocity, vertical"""
    velocity_p_xy: float = parameter(3.5, unit="1/s", ge=0.0, le=10.0, step=0.05, flight_step=2.0)
    """from the velocity error to the acceleration, horizontal"""
    velocity_p_z: float = parameter(5.0, unit="1/s", ge=0.0, le=15.0, step=0.05, flight_step=2.0)
    """from the velocity error to the acceleration, vertical"""
    velocity_i_xy: float = parameter(1.5, unit="1/s²", ge=0.0, le=10.0, step=0.05, flight_step=1.0)
    """from the integral of the velocity error, horizontal"""
    velocity_i_z: float = parameter(2.5, unit="1/s²", ge=0.0, le=10.0, step=0.05, flight_step=1.0)
    """from the integral of the velocity error, vertical"""
    attitude_p_xy: float = parameter(5.0, unit="1/s", ge=0.0, le=12.0, step=0.1, flight_step=2.0)
    """from the attitude error to the rate, roll and pitch"""
    attitude_p_z: float = parameter(2.4, unit="1/s", ge=0.0, le=6.0, step=0.1, flight_step=1.0)
    """from the attitude error to the rate, yaw"""
    rate_p_xy: float = parameter(12.0, unit="1/s", ge=0.0, le=40.0, step=0.5, flight_step=5.0)
    """from the rate error to the angular acceleration, roll and pitch"""
    rate_p_z: float = parameter(5.0, unit="1/s", ge=0.0, le=20.0, step=0.5, flight_step=2.0)
    """from the rate error to the angular acceleration, yaw"""
    rate_i_xy: float = parameter(6.0, unit="1/s²", ge=0.0, le=50.0, step=0.5, flight_step=5.0)
    """from the integral of the rate error, roll and pitch"""
    rate_i_z: float = parameter(2.0, unit="1/s²", ge=0.0, le=20.0, step=0.5, flight_step=2.0)
    """from the integral of the rate error, yaw"""
    rate_d: float = parameter(0.0, ge=0.0, le=1.0, step=0.01, flight_step=0.2)
    """from the measured angular acceleration, roll and pitch"""
    rate_cutoff: float = parameter(190.0, unit="rad/s", ge=10.0, le=600.0, step=10.0)
    """low pass of the measured angular acceleration"""


class GeometricL1Parameters(Parameters):
    """The adaptation law, and the disturbance that is subtracted from the commands of the geometric
    law.
    """

    force_pole: float = parameter(1.0, unit="1/s", ge=0.1, le=50.0, step=0.1, flight_step=10.0)
    """decay of the state predictor's velocity error"""
    torque_pole: float = parameter(1.0, unit="1/s", ge=0.1, le=50.0, step=0.1, flight_step=10.0)
    """decay of the state predictor's angular velocity error"""
    force_cutoff: float = parameter(25.0, unit="rad/s", ge=0.1, le=40.0, step=0.1, flight_step=5.0)
    """low pass C(s) of the force"""
    torque_cutoff: float = parameter(
        20.0, unit="rad/s", ge=0.05, le=40.0, step=0.05, flight_step=5.0
    )
    """low pass C(s) of the torque"""
    across: bool = parameter(True)
    """take the force across z_B off the desired force too; false: along z_B only, as printed"""
    force_max: float = parameter(6.0, unit="N", ge=0.0, le=10.0, step=0.1, flight_step=2.0)
    """largest force taken off, each axis"""
    torque_max: float = parameter(0.3, unit="N m", ge=0.0, le=1.0, step=0.01, flight_step=0.2)
    """largest torque taken off, each axis"""


class IndiParameters(Parameters):
    """The filters of the incremental law; gains are those of `control.attitude`."""

    cutoff: float = parameter(140.0, unit="rad/s", ge=5.0, le=200.0, step=1.0, flight_step=20.0)
    """of the second-order low pass of angular velocity and actuators alike"""
    damping: float = parameter(0.7, ge=0.4, le=1.5, step=0.05)
    """its damping ratio"""
    yaw_cutoff: float = parameter(20.0, unit="rad/s", ge=2.0, le=200.0, step=1.0, flight_step=10.0)
    """the same about z_B, where the motors' torque is weak"""


class FlatnessIndiParameters(IndiParameters):
    """The filters of both incremental loops."""

    force_cutoff: float = parameter(
        30.0, unit="rad/s", ge=2.0, le=100.0, step=1.0, flight_step=10.0
    )
    """of the second-order low pass of acceleration and thrust alike"""


class NmpcParameters(Parameters):
    """Horizon, bounds and weights of the predictive law."""

    horizon: float = parameter(0.4, unit="s", ge=0.2, le=2.0, step=0.05)
    """of its 20 nodes; the reference is continued over it by its derivatives"""
    position_xy: float = parameter(200.0, ge=0.0, le=2000.0, step=10.0)
    """weight of the horizontal position error, 1/m²"""
    position_z: float = parameter(400.0, ge=0.0, le=2000.0, step=10.0)
    """weight of the vertical position error, 1/m²"""
    velocity: float = parameter(10.0, ge=0.0, le=200.0, step=1.0)
    """weight of the velocity error, s²/m²"""
    tilt: float = parameter(5.0, ge=0.0, le=500.0, step=1.0)
    """weight of the attitude error about x and y, 1/rad²"""
    yaw: float = parameter(10.0, ge=0.0, le=500.0, step=1.0)
    """weight of the attitude error about z, 1/rad²"""
    rates: float = parameter(2.0, ge=0.0, le=50.0, step=0.1)
    """weight of the error of the body rates, s²/rad²"""
    thrust: float = parameter(20.0, ge=0.01, le=100.0, step=0.01)
    """weight of the thrust of each rotor, 1/N²"""
    last: float = parameter(5.0, ge=0.0, le=100.0, step=1.0)
    """multiple of the weights at the last node"""
    adaptive: bool = parameter(True)
    """take the L1 estimate of force and torque into the model; false: as in Sun et al."""
    force_cutoff: float = parameter(25.0, unit="rad/s", ge=0.1, le=40.0, step=0.1, flight_step=5.0)
    """low pass C(s) of the force"""
    torque_cutoff: float = parameter(
        20.0, unit="rad/s", ge=0.05, le=40.0, step=0.05, flight_step=5.0
    )
    """low pass C(s) of the torque"""
    force_max: float = parameter(5.0, unit="N", ge=0.0, le=10.0, step=0.1, flight_step=2.0)
    """largest estimated force, along z_B and each axis across"""
    torque_max: float = parameter(0.3, unit="N m", ge=0.0, le=1.0, step=0.01, flight_step=0.2)
    """largest estimated torque, each axis"""
