"""Access to the page: accounts, sessions, sign-in, and the gate in front of every route."""
