"""The simulated vehicle: plant, sensors and the microcontroller's firmware behind serial ports.

It speaks the real bytes, so that the flight stack cannot tell it from the robot.
"""
