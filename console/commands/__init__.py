"""Commands at the station: the gateway to the vehicle, the control lease, the sticks."""
