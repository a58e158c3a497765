"""Adaptive estimation of mass and inertia (Sec. 5.4)."""
