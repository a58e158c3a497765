"""MAVLink's common message set. pymavlink (LGPL) is an optional extra and imported only here."""

from pymavlink.dialects.v20 import common as mavlink

__all__ = ["mavlink"]
