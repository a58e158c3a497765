"""The drag of the whole vehicle, from circles."""
