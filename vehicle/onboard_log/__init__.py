"""The log on board: every tick while armed, kept in a ring of files that survive a power cut."""
