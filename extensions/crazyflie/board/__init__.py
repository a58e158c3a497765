"""The Crazyflie over its radio: body rates or angles, and thrust, are sent as CRTP set-points."""
