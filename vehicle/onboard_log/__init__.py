"""The onboard log: every tick while armed, in a ring of files that survive a power cut."""
