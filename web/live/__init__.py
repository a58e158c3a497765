"""Live content of the page: the newest messages, events, telemetry."""
