"""A link that loses, delays, narrows and interrupts, between two separate network namespaces."""
