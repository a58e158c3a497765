"""Comparison of the tracker's poses with the inertial sensors, independently of any estimator."""
