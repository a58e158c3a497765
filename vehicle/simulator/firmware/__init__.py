"""The simulated microcontroller's firmware: registers, serial protocol, its own control modes."""
