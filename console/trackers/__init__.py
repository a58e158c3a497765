"""Tracking systems of a laboratory; each runs in its own process."""
