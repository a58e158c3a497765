"""Campaigns over recorded flights, and the trends of their figures."""
