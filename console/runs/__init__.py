"""Recorded runs: recording, files, marks, trash, and disk space."""
