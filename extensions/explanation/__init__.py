"""What happened in a flight and why: findings with their figures and evidence, causes first."""
