"""The behaviors of the vehicle: one behavior at a time, each writing the reference.

`table` says which behavior may follow which, and why not; `machine` runs them.
"""
