"""The link compared with plain UDP, impaired and broken."""
