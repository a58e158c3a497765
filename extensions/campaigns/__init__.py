"""Campaigns: many flights by one plan, on one computer or several, and back to each of them.

A plan (`plan`) has cells (`design`), and flights in each; a flight (`flights`) is a function of the
plan and its index alone. Engines (`local_engine`, `dask_engine`) fly them, a folder (`folder`)
keeps their rows, `summary` and `compare` judge these.
"""
