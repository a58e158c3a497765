"""The simulated plant and the geometric law as FMUs: C sources, their description, the archive."""
