"""Beacons on the page: their tab's routes and feed, and what the 3D view shows of them."""
