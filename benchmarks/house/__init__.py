"""The size and shape of the source tree, and the budget that it has to keep."""
