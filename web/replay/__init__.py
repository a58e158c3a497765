"""Any recorded run on the page again: 3D, charts, time line; two runs over each other."""
