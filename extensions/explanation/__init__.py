"""The explanation of a flight: findings with their figures and evidence, causes first."""
