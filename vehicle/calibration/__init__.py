"""Calibrations on board: applied to samples, stored on disk, selected at each start."""
