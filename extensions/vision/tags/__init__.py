"""Poses of rigid bodies from pictures of AprilTag and ArUco markers on them."""
