"""Experiments that the station runs on the connected vehicle."""
