"""CRTP, the packets of the Crazyflie, and the links that carry them."""
