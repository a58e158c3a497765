"""Faults of the simulated vehicle, its sensors and the air around it, with schedules."""
