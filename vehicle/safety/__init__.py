"""The vehicle's own reactions to failures, and the detection of ground contact."""
