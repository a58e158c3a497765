"""Parameters on the wire: messages, services, and which process keeps which."""
