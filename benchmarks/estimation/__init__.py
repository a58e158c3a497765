"""Poses and filters compared with peers and bounds."""
