"""Recorded runs: list, labels, trash, links and recordings for the browser.

A run is found by its id in the catalogue and never by a path from outside.
"""
