"""3D view: viser behind the page's own port, and what is drawn in it."""
