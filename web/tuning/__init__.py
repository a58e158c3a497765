"""Step tests from the page: flown, read from the vehicle's log, judged, stored, compared."""
