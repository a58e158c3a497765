"""The flight process's interface to the microcontroller: ports, clock, samples, motor bus."""
