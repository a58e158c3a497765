"""Calibrations on board: applied to samples, kept on disk, chosen at each start."""
