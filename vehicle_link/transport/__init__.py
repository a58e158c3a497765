"""Zenoh sessions and nodes as ROS 2 sees them, and how well they carry."""
