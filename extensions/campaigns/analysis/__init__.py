"""What the rows of a campaign say of its factors, and the report with its figures."""
