"""Settings page: vehicles and users of this station, and its checks."""
