"""The noise of the inertial sensors, at rest and in hover."""
