"""The comms process: everything between the vehicle and the link, beside the flight process."""
