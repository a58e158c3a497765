"""Transfers from the vehicle's disk to this one: whole logs, and what a run lacks of them."""
