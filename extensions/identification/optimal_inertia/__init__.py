"""The inertia from the excitations that promise the most information in the time given."""
