"""Peers of other makes, flown or solved next to ours."""
