"""The behaviors of the vehicle: one behavior at a time, each writing the reference.

`table` defines which behavior may follow which, and the reasons of refusals; `machine` runs them.
"""
