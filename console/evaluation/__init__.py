"""What a log says of an experiment: figures, limits, verdicts."""
