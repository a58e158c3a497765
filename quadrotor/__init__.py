"""Shared vocabulary of quadlab: rotations, records, vehicle model, parameters, errors.

Layer 0: no clock, no randomness, no I/O but for reading Python files and caching compiled code.
Frames, units and quaternion order are defined in docs/conventions.md.
"""
