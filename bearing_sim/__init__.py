"""Simulated measurements: a tracking system and bearings to beacons, from true poses.

numpy only. Deterministic: the same poses and seed give the same measurements.
"""

from bearing_sim.beacon_file import load_beacons
from bearing_sim.beacons import PAPER_BEACONS, PRESETS, Beacons, format_layout, parse_layout
from bearing_sim.emulator import BearingEmulator, BearingMeasurement, BearingParameters
from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.tracker import SimulatedTracker, TrackerParameters

__all__ = [
    "PAPER_BEACONS",
    "PRESETS",
    "Beacons",
    "BearingEmulator",
    "BearingMeasurement",
    "BearingParameters",
    "PoseMeasurement",
    "SimulatedTracker",
    "TrackerParameters",
    "format_layout",
    "load_beacons",
    "parse_layout",
]
