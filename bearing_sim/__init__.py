"""Simulated measurements: a tracking system and bearings to beacons, from true poses.

numpy only. Deterministic: the same poses and seed give the same measurements.
"""

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from bearing_sim.emulator import BearingEmulator, BearingMeasurement, BearingParameters
from bearing_sim.tracker import PoseMeasurement, SimulatedTracker, TrackerParameters

__all__ = [
    "PAPER_BEACONS",
    "Beacons",
    "BearingEmulator",
    "BearingMeasurement",
    "BearingParameters",
    "PoseMeasurement",
    "SimulatedTracker",
    "TrackerParameters",
]
