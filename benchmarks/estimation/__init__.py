"""Poses and filters next to peers and bounds."""
