"""The simulated tracking system, served as the bytes of VRPN, NatNet and QTM-RT."""
