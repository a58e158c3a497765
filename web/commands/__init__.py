"""Commands of the page: behaviours, control, emergencies, sticks."""
