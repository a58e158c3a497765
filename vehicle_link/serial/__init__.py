"""The microcontroller's serial contract: frames, typed messages, ports."""
