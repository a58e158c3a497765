"""The microcontroller as the flight process sees it: ports, clock, samples, motor bus."""
