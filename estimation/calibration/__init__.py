"""Calibration and identification (Sec. 5 of the paper) as pure computation: samples in, result out.

Every result says how good it is; every refusal says what came, what was allowed, what to try.
"""
