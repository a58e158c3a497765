"""The real Betaflight as the simulated vehicle's board, in a process next to this one."""
