"""Features that a user could do without: each a folder that declares what it offers."""
