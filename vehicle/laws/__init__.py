"""External control laws above a built-in one, which flies whenever an answer is missing.

`vehicle.laws.external` disengages for good a law that fails; `vehicle.plugins` runs its process.
"""
