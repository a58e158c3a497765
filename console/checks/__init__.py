"""What the station looks at: before each arming (`preflight`), and at its start."""
