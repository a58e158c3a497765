"""A simulated Crazyflie: its protocol, inner loops, supervisor and radio, on our plant."""
