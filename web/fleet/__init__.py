"""The page of several vehicles."""
