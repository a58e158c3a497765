"""Poses from one frame of bearings to known beacons (Sec. 6.2)."""
