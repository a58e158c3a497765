"""The actions of `quadlab log`, one or two per file."""
