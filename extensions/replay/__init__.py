"""Replay of any recorded run on the page: 3D, charts, time line; two runs compared."""
