"""A recorded flight: its samples, measurements and truth, and the errors of estimates of it."""
