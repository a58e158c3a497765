"""Import of other systems' recorded flights: each is read, checked, and written as a run."""
