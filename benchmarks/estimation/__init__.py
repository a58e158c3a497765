"""Poses and filters beside peers and bounds."""
