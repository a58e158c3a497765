"""Sensors of the user's own: plugins whose readings correct the error-state filter."""
