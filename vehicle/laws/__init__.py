"""External control laws: files of the folder `plugins`, and programs that answer over UDP.

An external law runs in a process of its own. In each tick it receives the vectors of
`vehicle.laws.contract`; its answer is used one tick later. The built-in law is computed as well in
every tick and flies whenever the answer is missing; `vehicle.laws.external` disengages for good a
law that fails.
"""
