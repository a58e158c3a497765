"""Several vehicles that see each other by bearings, and fly as a formation."""
