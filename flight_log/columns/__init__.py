"""Logs read once, as columns that are kept on the disk."""
