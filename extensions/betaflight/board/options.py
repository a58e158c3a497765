"""The options of a board with Betaflight."""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter


class BetaflightOptions(Parameters):
    """Configuration of the board; `quadlab vehicle --board betaflight --check` compares them."""

    level: str = parameter("rates", choices=("rates", "angles"))
    """what the board holds: body rates, or roll and pitch angles in its mode ANGLE"""
    angle_gain: float = parameter(5.0, unit="1/s", ge=1.0, le=20.0, step=0.1)
    """stiffness of its angle loop, a tenth of its `angle_p_gain`"""
    newer: bool = parameter(False)
    """fly a firmware newer than the newest that was tried, 4.6"""
    rate_max: float = parameter(400.0, unit="°/s", ge=100.0, le=1000.0, step=10.0)
    """body rate of a full stick, the same about all axes"""
    angle_max: float = parameter(35.0, unit="°", ge=10.0, le=60.0, step=1.0)
    """angle of a full stick"""
    idle: float = parameter(5.5, unit="%", ge=0.0, le=20.0, step=0.1)
    """motor output at the lowest throttle, its `motor_idle`"""
    min_check: int = parameter(1010, unit="µs", ge=1000, le=1200)
    """pulse of the lowest throttle"""
    landing_throttle: int = parameter(1470, unit="µs", ge=1000, le=2000)
    """throttle of its own landing without a barometer, a little under hover's"""
    hover_throttle: int = parameter(1475, unit="µs", ge=1100, le=1700)
    """throttle in hover, from which it lands by its barometer"""
    landing_speed: float = parameter(0.5, unit="m/s", ge=0.1, le=2.0, step=0.1)
    """speed of its own landing by its barometer"""
    landing_time: int = parameter(20, unit="s", ge=1, le=250)
    """its own landing ends after this, motors off"""
    failsafe_delay: float = parameter(0.2, unit="s", ge=0.1, le=0.2, step=0.1)
    """time without commands until it lands; after 0.3 s it would cut its throttle"""
