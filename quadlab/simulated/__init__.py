"""Flights in simulated time: the whole stack in one process."""
