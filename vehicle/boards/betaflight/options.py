"""The options of a board with Betaflight."""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter


class BetaflightOptions(Parameters):
    """The configuration of the board; `quadlab vehicle --board betaflight --check` compares."""

    rate_max: float = parameter(
        400.0,
        unit="deg/s",
        ge=100.0,
        le=1000.0,
        step=10.0,
        description="body rate of a full stick, the same about all axes",
    )
    angle_max: float = parameter(
        35.0, unit="deg", ge=10.0, le=60.0, step=1.0, description="angle of a full stick"
    )
    idle: float = parameter(
        5.5,
        unit="%",
        ge=0.0,
        le=20.0,
        step=0.1,
        description="motor output at the lowest throttle, its `motor_idle`",
    )
    min_check: int = parameter(
        1010, unit="µs", ge=1000, le=1200, description="pulse of the lowest throttle"
    )
    landing_throttle: int = parameter(
        1470,
        unit="µs",
        ge=1000,
        le=2000,
        description="throttle of its own landing, a little under hover's: no sensor helps it",
    )
    landing_time: int = parameter(
        10, unit="s", ge=1, le=250, description="its own landing ends after this, motors off"
    )
    failsafe_delay: float = parameter(
        0.2,
        unit="s",
        ge=0.1,
        le=2.0,
        step=0.1,
        description="time without commands after which it lands on its own",
    )
