"""MAVLink's common message set. pymavlink (LGPL) is an optional extra and imported only here."""

from pymavlink.dialects.v20 import common as mavlink
from pymavlink.dialects.v20.common import MAVLink_message

__all__ = ["MAVLink_message", "mavlink"]
