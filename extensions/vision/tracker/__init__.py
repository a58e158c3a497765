"""Cameras as sources of frames, and what people see of them."""
