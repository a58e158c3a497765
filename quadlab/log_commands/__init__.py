"""What `quadlab log` does, one file an action or two."""
