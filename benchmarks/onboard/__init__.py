"""The flight loop and what runs in it."""
