"""Estimators compared at the station, against the truth and next to the vehicle's own."""
