"""Analyses of a campaign's factors by its rows, and the report with its figures."""
