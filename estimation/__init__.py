"""State estimation of Sec. 6: complementary filter, pose from bearings, mass (Sec. 5.4).

Layer 1: it imports only quadrotor. Laws are compiled functions on structured records.
"""
