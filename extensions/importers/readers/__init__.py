"""Readers of the formats of other systems: each shows a file as tables of numbers by column."""
