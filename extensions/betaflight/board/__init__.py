"""Boards with Betaflight: body rates and throttle are sent as stick commands by MSP or CRSF."""
