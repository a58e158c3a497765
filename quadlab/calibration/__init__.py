"""A guided calibration at a terminal."""
