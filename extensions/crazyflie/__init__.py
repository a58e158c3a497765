"""The Crazyflie over its radio: body rates or angles, and thrust, as CRTP set-points."""

NAME = "crazyflie"
