"""The events of a flight, in order of weight: each claim with its figure and its evidence."""
