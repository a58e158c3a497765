"""The C firmware against its specification, the Python one; its cost on the chip."""
