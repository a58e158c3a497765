"""The quality of a link to a vehicle, measured and judged."""
