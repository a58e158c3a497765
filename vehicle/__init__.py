"""The vehicle's side: flight and comms processes, and the simulator that replaces the hardware."""
