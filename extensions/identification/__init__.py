"""Identifications beyond the paper: drag, vibration, and the tracked body."""
