"""The simulated microcontroller's program: registers, bytes, and what it flies by itself."""
