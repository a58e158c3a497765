"""Boards with Betaflight: body rates and throttle as stick commands, told by MSP."""
