"""Law over UDP that uses nothing of this project, like the blocks of Simulink or Octave.

It needs only struct and socket. Argument: how many inputs it answers before it falls silent.
"""

from __future__ import annotations

import socket
import struct
import sys

port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
port.bind(("127.0.0.1", 0))
print(port.getsockname()[1], flush=True)
for _ in range(int(sys.argv[1])):
    data, sender = port.recvfrom(2048)
    u = struct.unpack("<39d", data)
    p, v, q, omega = u[4:7], u[7:10], u[10:14], u[14:17]
    r, r_dot, r_ddot, (yaw, yaw_rate) = u[17:20], u[20:23], u[23:26], u[32:34]
    mass, inertia = u[35], u[36:39]
    ax, ay, az = (
        kp * (r[i] - p[i]) + kv * (r_dot[i] - v[i]) + r_ddot[i]
        for i, (kp, kv) in enumerate([(4.0, 3.5), (4.0, 3.5), (8.0, 5.0)])
    )
    roll, pitch = 2.0 * (q[0] * q[1] + q[2] * q[3]), 2.0 * (q[0] * q[2] - q[1] * q[3])
    heading = 2.0 * q[0] * q[3]
    torque = (
        inertia[0] * (60.0 * (-ay / 9.81 - roll) - 12.0 * omega[0]),
        inertia[1] * (60.0 * (ax / 9.81 - pitch) - 12.0 * omega[1]),
        inertia[2] * (12.0 * (yaw - heading) + 5.0 * (yaw_rate - omega[2])),
    )
    port.sendto(struct.pack("<5d", u[0], mass * (9.81 + az), *torque), sender)
