"""Rates of topics in a log of a simulated flight."""

from __future__ import annotations

RATES = {
    "state": 500,
    "reference": 500,
    "imu": 500,
    "actuators": 500,
    "truth": 100,
    "tracker_pose": 100,
    "bearings": 30,
    "bearing_pose": 30,
    "estimator": 50,
    "status": 10,
    "battery": 2,
    "pressure": 25,
}
"""Messages a second, by topic, while the tracker and the emulated bearings are on."""
