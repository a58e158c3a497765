"""Estimators compared at the station, against the truth and beside the vehicle's own."""
