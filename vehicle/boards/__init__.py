"""The boards that turn the flight stack's commands into motor speeds, one folder per board."""
