"""Recorded runs: recording, files, marks, trash, and the room on the disk."""
