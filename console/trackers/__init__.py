"""Tracking systems of a laboratory, each the source of a process of its own."""
