"""Web process: the page, its API and the 3D view behind one port."""
