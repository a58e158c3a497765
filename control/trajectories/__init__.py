"""References as functions of time: position to snap, yaw to yaw acceleration.

A trajectory is created once (plain Python may refuse it) and sampled at every tick by one compiled
call. All are C4 in position, and start and end at rest unless documented otherwise.
"""
