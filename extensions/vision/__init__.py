"""Cameras: poses of tagged bodies, bearings to tags and LEDs on board, and their calibration."""
