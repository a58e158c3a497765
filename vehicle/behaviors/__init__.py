"""Users' own behaviors: a plugin's references, which the behavior `external` checks and flies."""
