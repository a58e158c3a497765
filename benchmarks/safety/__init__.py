"""A whole laboratory under attack: processes that fail or starve, hostile bytes, foreign pages."""
