"""Searches for the best parameters: trials that a sampler proposes, each flown by all its seeds."""
