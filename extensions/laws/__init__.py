"""Control laws of the literature, each one file of equations with its source.

All take the same state, reference, gains and model as the paper's law, allocate by the same rule
(`control.allocation`), and fly through the same door (`control.laws`).
"""
