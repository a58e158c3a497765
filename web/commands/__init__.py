"""Commands of the page: behaviors, control, emergencies, sticks."""
