"""MSP v2 and CRSF, the protocols that Betaflight speaks on its UARTs."""
