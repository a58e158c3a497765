"""Control laws from outside: files of the folder `plugins`, and programs that answer over UDP.

A law from outside runs in a process of its own. In each tick it receives the vectors of
`vehicle.laws.contract`; its answer is used one tick later. The built-in law is computed as well in
every tick and flies whenever the answer is missing; `vehicle.laws.outside` takes a law out for good
when it fails.
"""
