"""Who may come in and do what: accounts, sessions, the door and the gate before every route."""
