"""Columns of logs, read once and stored on disk."""
