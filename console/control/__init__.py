"""Who commands: one lease, kept by the station for all who reach it."""
