"""Experiments: the same script flies the simulated vehicle and the real one."""
