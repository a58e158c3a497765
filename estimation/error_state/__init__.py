"""Tightly coupled error-state Kalman filter on IMU samples, poses and raw bearings."""
