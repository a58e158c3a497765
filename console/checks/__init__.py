"""The station's checks: before each arming (`preflight`) and at its start (`startup`)."""
