"""The vehicle's own reactions when something fails, and whether it is on the ground or flies."""
