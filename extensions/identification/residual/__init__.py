"""Forces and torques that the model leaves unexplained in recorded flights, as drag by axis, the
height at which it acts, and loss of thrust by inflow."""
