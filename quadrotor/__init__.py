"""Shared vocabulary of quadlab: rotations, records, vehicle model, parameters, errors.

Layer 0: imports only numpy, numba and pydantic; no I/O, no clock, no randomness.
Frames, units and quaternion order are defined in docs/conventions.md.
"""
