"""The topics of a vehicle: their table, and conversions between payloads and tick records."""
