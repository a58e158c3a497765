"""Experiments, calibrations and their reports for the page."""
