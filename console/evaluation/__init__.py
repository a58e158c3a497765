"""The evaluation of an experiment from its log: figures, limits, verdicts."""
