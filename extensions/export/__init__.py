"""Logs as tables for other programs: CSV, Parquet, MATLAB."""
