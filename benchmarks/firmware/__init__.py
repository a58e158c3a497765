"""The C firmware compared with its specification, the Python one, and its cost on the chip."""
