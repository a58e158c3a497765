"""The exchange with a vehicle: what the station receives, asks for and sends regularly."""
