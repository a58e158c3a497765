"""Whole flights in compiled code: the vehicle's own laws with its simulated plant, many at a time.

The vehicle itself never imports this: its tick composes the same item-level functions in Python,
with plugins. Start with `extensions.batches.batch.fly_batch`.
"""
