"""Step tests of the gains: fetched from the vehicle's log, judged, and the last ones stored."""
