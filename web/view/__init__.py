"""The 3D view: viser behind our port, and what is drawn in it."""
