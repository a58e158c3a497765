"""Import of flights recorded by other systems: each format is read, checked, and written as a
run."""
