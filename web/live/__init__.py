"""The live content of the page: the newest messages, events, telemetry."""
