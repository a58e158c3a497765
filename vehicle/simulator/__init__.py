"""The simulated vehicle: plant, sensors and the microcontroller's firmware behind serial ports.

It uses the real serial protocol, so that the flight stack cannot distinguish it from the robot.
"""
