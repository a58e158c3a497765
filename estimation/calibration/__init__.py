"""Calibration and identification (Sec. 5 of the paper) as pure computation: samples in, result out.

Every result includes its quality; every error states what was found, what is allowed and what to
try.
"""
