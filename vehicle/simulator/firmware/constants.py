"""The firmware's constants as the integers it computes with, from their physical values.

The microcontroller has no floating-point unit: quantities are whole multiples of the unit that the
comment at each constant gives, `2^-n` of an SI unit or of a converter's count. They are those of
the nominal vehicle; the true one may differ. `python -m vehicle.simulator.firmware.header` writes
the same constants for the C firmware.
"""

from __future__ import annotations

import math

from quadrotor.vehicle_model import GRAVITY, VehicleModel
from vehicle.simulator import sensors
from vehicle.simulator.sensors import ACCELEROMETER_SCALE, GYROSCOPE_SCALE, PRESSURE_LAPSE
from vehicle_link.serial import attitude_command as command

_model = VehicleModel()
_weight = _model.mass * GRAVITY  # N
_g = GRAVITY / ACCELEROMETER_SCALE  # counts
_degree = math.radians(1.0)
_gain_unit = 0.1 / 128  # rad/s^2: of an angular acceleration; a gain's register counts 0.1


def _thrust(reference: float) -> float:
    return (_model.motor_slope * (reference + _model.motor_offset)) ** 2  # N


# ---------------------------------------------------------------- converters
CONVERTER_ZERO = sensors.ZERO  # count
CONVERTER_MAX = sensors.FULL_SCALE  # count
FORCE_MAX = 1023  # count, of the specific force less its offset
HEIGHT_SLOPE = round(2**18 / PRESSURE_LAPSE)  # 2^-18 m per Pa

# ---------------------------------------------------------------- attitude
FORCE_SQUARE_MIN = round((0.7 * _g) ** 2)  # count^2: used as a direction in between
FORCE_SQUARE_MAX = round((1.3 * _g) ** 2)
# 1/|f| near g, to first order: (NEAR - SLOPE |f|^2 / 2^16), 2^-14 of 256 counts
INVERSE_NEAR = round(2**14 * 1.5 * 256 / _g)
INVERSE_SLOPE = round(2**30 * 0.5 * 256 / _g**3)
# Gains towards the accelerometer's direction: 2^-16 count of rate per 2^-14 rad, times 2^4.
# 4 rad/s with motors off; in flight, where it measures thrust and drag too, 0.1 rad/s.
CORRECTION_RESTING = round(4.0 / GYROSCOPE_SCALE * 2**6)
CORRECTION_FLYING = round(0.1 / GYROSCOPE_SCALE * 2**6)
# Used instead when the two differ by more than the sine 0.1: a moving vehicle is tilted.
CORRECTION_TURNED = round(0.01 / GYROSCOPE_SCALE * 2**6)
TURNED_SQUARE = round((0.1 * 2**14) ** 2)
# With motors off, a rotation slower than 40 deg/s about each axis counts as drift, as a cold
# gyroscope has such a drift. What is learnt while the vehicle is carried around decays within
# seconds once it is at rest.
STILL = round(40.0 * _degree / GYROSCOPE_SCALE * 2**16)  # 2^-16 count
DRIFT_MAX = 100 << 24  # 2^-24 count: 58.6 deg/s

# ---------------------------------------------------------------- angles, 2^-15 rad
HALF_TURN = round(math.pi * 2**15)
QUARTER_TURN = round(0.5 * math.pi * 2**15)
# M. Abramowitz, I. Stegun, "Handbook of Mathematical Functions", 4.4.49: to 1e-5 rad
ATAN_1 = round(0.9998660 * 2**15)
ATAN_3 = round(-0.3302995 * 2**15)
ATAN_5 = round(0.1801410 * 2**15)
ATAN_7 = round(-0.0851330 * 2**15)
ATAN_9 = round(0.0208351 * 2**15)

# ---------------------------------------------------------------- climb
GRAVITY_COUNTS = round(_g * 2**14)  # 2^-14 count
HEIGHT_ERROR_MAX = 16 << 18  # 2^-18 m: a larger error counts as this one
CLIMB_MAX = 64 << 22  # 2^-22 m/s
CLIMB_BIAS_MAX = 100 << 22  # 2^-22 count
SHAKING = round(0.1 * _g * 2**14)
"""Vertical specific force off gravity, in 2^-14 count (0.1 g), up to which the vehicle may rest."""
DOUBT = round(0.25 * 2**22)
"""Difference of the climb rates of barometer and accelerometer, in 2^-22 m/s, that is doubted."""
DOUBT_MAX = 16 << 22  # 2^-22 m/s
DOUBT_TIME = round(0.2 * 2**22)  # 2^-22 s for which it lasts
DOUBT_LASTS = round(2.2 * 2**22)
"""The doubt ends 2 s after the difference, in 2^-22 s."""
SHOCK = round(1.9 * _g)
"""Specific force, in counts, that only a hard touch-down gives, and ± 2 g do not measure."""

# ---------------------------------------------------------------- near-hovering
WANTED_ANGLE = round(2**15 / command.ANGLE_COUNTS)  # 2^-15 rad a count of the command
WANTED_YAW_RATE = round(2**16 / command.YAW_RATE_COUNTS / GYROSCOPE_SCALE)  # 2^-16 count a count
WANTED_THRUST = round(_weight / command.HOVER_THRUST * 2**18)  # 2^-18 N a count
RATE_GAIN = round(GYROSCOPE_SCALE * 2**3 * 2**16)  # 2^-4 count times a gain to _gain_unit, 2^-16
ACCELERATION_MAX = 1 << 23  # _gain_unit: 6550 rad/s^2
YAW_CHANGE_MAX = 32767
INTEGRAL_MAX = round(0.2 * 2**30)  # 2^-30 rad s
INTEGRATED = round(0.1 * 2**15)  # 2^-15 rad: a larger error is a manoeuvre rather than a trim
# Thrust of a motor, 2^-12 N, per _gain_unit: 2^-16; about z 2^-18.
SHARE_ROLL = round(_model.inertia_xx / (2.0 * _model.arm) * _gain_unit * 2**28)
SHARE_PITCH = round(_model.inertia_yy / (2.0 * _model.arm) * _gain_unit * 2**28)
SHARE_YAW = round(_model.inertia_zz / (4.0 * _model.torque_ratio) * _gain_unit * 2**26)
MILLI_ROLL = round(1000.0 * _model.inertia_xx * _gain_unit * 2**16)  # 2^-16 mN m per _gain_unit
MILLI_PITCH = round(1000.0 * _model.inertia_yy * _gain_unit * 2**16)
MILLI_YAW = round(1000.0 * _model.inertia_zz * _gain_unit * 2**16)

# ---------------------------------------------------------------- motors
THRUST_MIN = round(_thrust(_model.motor_reference_min) * 2**12)  # 2^-12 N
THRUST_MAX = round(_thrust(_model.motor_reference_max) * 2**12)
THRUST_HOVER = min(THRUST_MAX, max(THRUST_MIN, round(0.25 * _weight * 2**12)))
REFERENCE_SLOPE = round(2**9 / _model.motor_slope)  # 2^-8 count per 2^-14 sqrt(N), times 2^15
REFERENCE_OFFSET = round(_model.motor_offset * 2**8)  # 2^-8 count
REFERENCE_MAX = 255
MOTOR_OFFSET = round(_model.motor_offset * 2**7)  # 2^-7 count
MOTOR_SQUARE = round(_model.motor_slope**2 * 2**26)  # 2^-24 N per 2^2 count^2

# ---------------------------------------------------------------- descent
STANDING = round(0.6 * _weight * 2**24)
"""Thrust, in 2^-24 N (0.6 of the weight): below it, on average and now, the vehicle is on the
ground."""
STARTING = round(0.3 * _weight * 2**24)
"""Average thrust, in 2^-24 N (0.3 of the weight), below which it has not lifted off yet."""
WEIGHT = round(_weight * 2**24)  # 2^-24 N
SUPPORT_UNIT = round(_model.mass * ACCELEROMETER_SCALE * 2**24)
"""From specific force (counts) over thrust (2^-12 N) to 2^-12 of what thrust gives in the air."""
SUPPORT_MAX = 4 << 12
CARRIED_SHARE = round(1.1 * 2**10)
"""Specific force over that in the air, 2^-10; the ground carries the rest."""
CARRIED_TIME = round(0.1 * 2**22)  # 2^-22 s, after which the ground is presumed, and tested
BLOW = round(0.35 * _g * 2**16)
"""Mean specific force beyond that of the thrust, in 2^-16 count, which only a touch-down gives."""
BLOW_LASTS = round(1.0 * 2**22)  # 2^-22 s, for which a blow presumes the ground
UNLOAD_MOST = round(0.7 * _weight * 2**24)
"""Thrust, in 2^-24 N, that is taken away to see whether the specific force falls with it."""
UNLOAD_RAMP = round(4.0 * _weight * 2**9)  # 4 weights/s: 2^-24 N per 2^-22 s, times 2^7
PULL = round(2**8 / (_model.mass * ACCELEROMETER_SCALE))  # 2^-16 count per 2^-24 N, times 2^16
SHOWN_MEAN = round(_g * 2**16)  # 2^-16 count
SHOWN_MARGIN = round(0.05 * _g * 2**16)
PULLING_LITTLE, PULLING_LESS = round(0.45 * _g * 2**16), round(0.5 * _g * 2**16)
"""Specific force by the thrust, in 2^-16 count, below which the ground carries a vehicle that shows
SHOWN_AT_REST; and by how much it has fallen where the ground does."""
SHOWN_AT_REST = round(0.85 * _g * 2**16)
TEST_DWELL = round(0.03 * 2**22)  # 2^-22 s
TEST_LONGEST = round(0.4 * 2**22)
SETTLING_CLIMB = round(-0.2 * 2**22)  # 2^-22 m/s: a slower descent is not used for learning
SINK = round(0.7 * 2**22)  # 2^-22 m/s
SINK_FLARE = round(0.35 * 2**22)
FLARE_HEIGHT = round(0.7 * 2**18)  # 2^-18 m above the take-off point
DEEPEST = round(-1.5 * 2**18)  # 2^-18 m above the take-off point
"""Below it the ground should have been found: the barometer leaks, the descent becomes faster."""
FASTER_SHIFT = 3  # by 2^-3 m/s^2
SPARE = 8 << 18
"""Duration, in 2^-18 s, by which a descent may exceed what its height needs at half its speed."""
SLOWNESS = round(2.0 / 0.7 * 2**13)  # 2^-13 s/m
HIGHEST = 20 << 18  # 2^-18 m
SINK_ERROR_MAX = 4 << 22  # 2^-22 m/s: a larger error asks for more than the greatest thrust
CLIMB_GAIN = round(5.0 * _model.mass * 2**12)  # 5/s: 2^-24 N per 2^-28 m/s, times 2^16
SLOW_SHARE = round(0.6 * 2**15)  # 2^-15
LEAST_WEIGHT = round(0.1 * _weight * 2**12)  # 2^-12 N
LIFT_COUNT = round(_weight / command.HOVER_THRUST * 2**24)  # 2^-24 N a count
LIFT_MAX = command.THRUST_MAX  # count
OVERTURNED = round(math.cos(math.radians(100.0)) * 2**14)
COSINE_MIN = 1 << 13  # 2^-14: least divisor of the thrust

# ---------------------------------------------------------------- registers
SHOW_ANGLE = round(10.0 / _degree * 2)  # 0.1 deg per 2^-15 rad, times 2^16
SHOW_RATE = round(10.0 / _degree * GYROSCOPE_SCALE * 2**11)  # 0.1 deg/s per 2^-16 count, 2^27
SHOW_DRIFT = round(100.0 / _degree * GYROSCOPE_SCALE * 2**8)  # 0.01 deg/s per 2^-24 count, 2^32
SHOW_FORCE = round(100.0 * ACCELEROMETER_SCALE * 2**12)  # 0.01 m/s^2 per count, 2^12
SHOW_THRUST = round(command.HOVER_THRUST / _weight * 2**11)  # count per 2^-24 N, times 2^35

# ---------------------------------------------------------------- gains by the period
PERIOD_MIN, PERIOD_MAX = 640, 47_000
"""Shortest and longest period, in 1/16 us, whose gains fit 16 bits."""
YAW_SLOPE = round(GYROSCOPE_SCALE / _gain_unit * 0.1 * 16e6)
"""Factor over the period: the yaw rate's change (counts) times a gain to _gain_unit."""


def _by_period(per_second: float) -> tuple[int, int]:
    """Return the factor and the shift that turn a period (1/16 us) into a gain."""
    shift = 14 - math.floor(math.log2(per_second / 16e6))
    return round(per_second / 16e6 * 2**shift), shift


_flying = 1.2  # rad/s: the observer's three poles
_resting = 12.0  # rad/s: of the height at rest; with motors off the vehicle is carried
GAIN_TURN, GAIN_TURN_SHIFT = _by_period(GYROSCOPE_SCALE * 2**30)
GAIN_REST, GAIN_REST_SHIFT = _by_period(2**8 / 0.5 * 2**14)  # drift averaged over 0.5 s
GAIN_DRIFT, GAIN_DRIFT_SHIFT = _by_period(0.005 / GYROSCOPE_SCALE * 2**24)  # 0.005 rad/s^2 per rad
GAIN_DRIFT_TURNED, GAIN_DRIFT_TURNED_SHIFT = _by_period(0.0005 / GYROSCOPE_SCALE * 2**24)
GAIN_SECOND, GAIN_SECOND_SHIFT = _by_period(2**22)
GAIN_UP, GAIN_UP_SHIFT = _by_period(ACCELEROMETER_SCALE * 2**24)
GAIN_HEIGHT, GAIN_HEIGHT_SHIFT = _by_period(3.0 * _flying * 2**16)
GAIN_HEIGHT_RESTING, GAIN_HEIGHT_RESTING_SHIFT = _by_period(_resting * 2**16)
GAIN_CLIMB, GAIN_CLIMB_SHIFT = _by_period(3.0 * _flying**2 * 2**17)
GAIN_BIAS, GAIN_BIAS_SHIFT = _by_period(_flying**3 / ACCELEROMETER_SCALE * 2**12)
GAIN_BIAS_RESTING, GAIN_BIAS_RESTING_SHIFT = _by_period(2**16 / 1.0)  # averaged over 1 s
# The accelerometer's climb rate follows that of the barometer with two poles of 0.1 rad/s.
GAIN_FELT, GAIN_FELT_SHIFT = _by_period(2.0 * 0.1 * 2**16)
GAIN_FELT_BIAS, GAIN_FELT_BIAS_SHIFT = _by_period(0.1**2 / ACCELEROMETER_SCALE * 2**16)
GAIN_INTEGRAL, GAIN_INTEGRAL_SHIFT = _by_period(2**23)
GAIN_THRUST, GAIN_THRUST_SHIFT = _by_period(2**16 / 0.5)  # thrust averaged over 0.5 s
GAIN_SUPPORT, GAIN_SUPPORT_SHIFT = _by_period(2**16 / 1.0)  # learnt over 1 s in the air
GAIN_SHOWN, GAIN_SHOWN_SHIFT = _by_period(2**16 / 0.02)  # averaged over 0.02 s
GAIN_PULLING, GAIN_PULLING_SHIFT = _by_period(2**16 / 0.06)  # lag of the motors, at most
GAIN_LIFT, GAIN_LIFT_SHIFT = _by_period(3.0 * _model.mass * 2**18)  # 3/s^2
