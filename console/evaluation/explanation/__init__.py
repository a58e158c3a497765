"""The events of a flight, ordered by weight: each claim with its figure and its evidence."""
