"""The boards that turn the flight stack's commands into turning motors, one folder a board."""
