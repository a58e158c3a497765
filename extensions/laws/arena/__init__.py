"""The arena: laws on courses under disturbances, in compiled flights paired by seed."""
