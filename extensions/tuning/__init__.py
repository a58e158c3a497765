"""Step tests: the response of a loop to a step of its reference, and the gains that flew it."""
