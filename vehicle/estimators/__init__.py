"""The estimators on board: their inputs, the choice of the one in use, and their monitoring."""
