"""Peers of other makes, flown or solved beside ours."""
