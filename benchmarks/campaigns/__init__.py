"""Benchmarks of the engine of campaigns, and benchmarks of flights that are plans for it."""
