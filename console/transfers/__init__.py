"""Transfers from the vehicle's disk to this one: whole logs, and missing parts of runs."""
