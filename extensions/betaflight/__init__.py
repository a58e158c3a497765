"""Boards with Betaflight: body rates and throttle, sent as stick commands by MSP or CRSF."""

NAME = "betaflight"
