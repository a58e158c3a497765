"""The link next to plain UDP, impaired and broken."""
