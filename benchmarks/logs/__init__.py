"""Logs: written under kill -9, fuzzed, read, exported."""
