"""Peers: other projects' software, flown or solved for comparison."""
