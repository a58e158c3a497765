"""Live connection of Foxglove, Lichtblick and other viewers with Foxglove's protocol."""
