"""Access to the page: accounts, sessions, the door and the gate before every route."""
