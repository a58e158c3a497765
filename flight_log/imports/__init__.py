"""Recorded flights of others: their formats are read into one record, checked, written as a run."""
