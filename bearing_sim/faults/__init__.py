"""Faults with schedules: their mechanism, and those of the simulated tracker and bearings."""
