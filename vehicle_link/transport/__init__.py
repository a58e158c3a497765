"""Zenoh sessions and nodes as ROS 2 sees them, and the quality of their links."""
