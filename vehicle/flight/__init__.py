"""The flight process: the tick from sample to motor commands, its loop, modes and commands."""
