"""Rendered pictures of the simulated vehicle and room, read as real ones are."""
