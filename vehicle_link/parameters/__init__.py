"""Parameters on the wire: messages, services, and which process is the authority of which."""
