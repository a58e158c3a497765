"""The checks of the station: before each arming (`preflight`), and at its start."""
