"""Step tests from the page: flown, fetched from the vehicle's log, judged, kept, compared."""
