"""The vehicle's side: flight and comms process, and the simulator that stands in for hardware."""
