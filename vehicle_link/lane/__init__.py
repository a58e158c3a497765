"""The lane: authenticated UDP datagrams next to the link, for data that are worthless when late.

QUIC holds packets back while its congestion window is small, as it is after losses; a sample that
is sent 100 times a second is better lost than late. So the latest telemetry, poses, bearings,
sticks and heartbeats travel as plain UDP, each datagram sealed by itself (`datagram`), between a
socket on the vehicle (`vehicle_lane`) and one at each station (`station_lane`). Everything else,
and everything while no lane is up, travels by Zenoh.

What protects it: the two keys of a lane, one for each direction, come in the answer of the
vehicle's service `lane`, hence over the link with mutual TLS, and are held in memory only. Each
datagram is encrypted and authenticated (ChaCha20-Poly1305) together with its header. Its counter
is the nonce: it rises with every datagram and is never used twice with a key, because every
answer and every start of a process has new keys. A datagram that is a duplicate, was not made
with the key, or has a topic that this end does not accept is dropped and counted. The vehicle
answers nothing unauthenticated, and sends to an address only while authenticated datagrams arrive
from it.

What it does not protect: an attacker on the path can drop or delay packets, as on every link,
and, by being faster than the station, redirect a lane to another address until the station's next
datagram; what then arrives there cannot be read. Sizes and times of datagrams can be observed.
Programs on the base station's loopback may ask for a lane as for everything else. There is no
forward secrecy within the life of a process: whoever reads its memory has its keys.
"""
