"""Speed and accuracy against peers and physical limits: `python -m benchmarks`."""
