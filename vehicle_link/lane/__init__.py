"""The lane: authenticated datagrams of our own next to the link, for what is worthless when late.

QUIC holds packets back while its congestion window is small, which after losses it is; a sample
100 times a second is better lost than late. So the newest telemetry, poses, bearings, sticks and
heartbeats travel as plain UDP, each datagram sealed by itself (`datagram`), between a socket on the
vehicle (`vehicle_lane`) and one at each station (`station_lane`). Everything else, and everything
while no lane stands, goes by Zenoh.

What protects it. The two keys of a lane, one for each direction, come as the answer of the
vehicle's service `lane`, so over the link with mutual TLS, and are in memory only. Each datagram is
encrypted and authenticated (ChaCha20-Poly1305) with its header; its counter is the nonce, rises
with every datagram and is never used twice with a key, for every answer and every start of a
process has new keys. A datagram that came already, that no one with the key has made, or whose
topic is not for this end is dropped and counted. The vehicle answers nothing that is not
authenticated, and sends to an address only while authenticated datagrams come from it.

What it does not protect. Who can change packets on the way can drop or delay them, as on every
link, and by being faster than the station turn a lane towards another address, until the station's
next datagram; what then arrives there cannot be read. Sizes and times of datagrams can be seen.
Programs on the base station's loopback may ask for a lane as they may ask for everything else.
There is no forward secrecy within the life of a process: who reads its memory has its keys.
"""
