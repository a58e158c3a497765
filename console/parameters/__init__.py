"""Parameters at the station: its own, the vehicle's, their history and named sets."""
