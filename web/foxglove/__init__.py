"""The live connection of Foxglove, Lichtblick and others that speak Foxglove's protocol."""
