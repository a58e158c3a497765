"""The real Betaflight firmware as the simulated vehicle's board, in a separate process."""
