"""The beacons in the 3D view."""
