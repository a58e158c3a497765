"""The link: messages and CDR, Zenoh sessions and nodes as ROS 2 sees them, parameters, log, serial.

Layer 1: imports of quadlab only quadrotor, and no numba. Zenoh, rosbags, mcap and pyserial are
used here and nowhere else.
"""
