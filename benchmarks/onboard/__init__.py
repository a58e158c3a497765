"""The flight loop and its parts."""
