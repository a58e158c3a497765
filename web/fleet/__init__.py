"""Several vehicles on one page."""
