"""The comms process: everything between the vehicle and the link, next to the flight process."""
