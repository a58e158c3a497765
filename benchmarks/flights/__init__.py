"""Whole flights: disturbed, failing, starved, several at once."""
