"""An extension of quadlab: the tracking system starlight."""
