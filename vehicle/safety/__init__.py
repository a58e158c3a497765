"""What the vehicle does by itself when something fails, and whether it stands or flies."""
