"""Flights with faults: which causes the explanation names."""
