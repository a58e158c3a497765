"""The link: messages and CDR, Zenoh sessions and nodes as ROS 2 sees them, parameters, serial.

Layer 1: of quadlab's packages it imports only quadrotor, and never numba. Zenoh and pyserial are
used here and nowhere else; rosbags here and in flight_log.
"""
