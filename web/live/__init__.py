"""What the page shows while it happens: the newest messages, events, telemetry."""
