"""A link that loses, delays, narrows and interrupts, between two network namespaces of our own."""
