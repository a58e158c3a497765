"""Experiments flown by the station on the vehicle at the other end of the link."""
