"""Calibration and identification (Sec. 5 of the paper) as pure computation: samples in, result out.

Every result has its quality; every error names what came, what was allowed and what to try.
"""
