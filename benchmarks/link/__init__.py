"""The link beside plain UDP, impaired and broken."""
