"""Users' own control laws and estimators: files of the folder `plugins`, packages, UDP programs.

A plugin runs in a process of its own. In each tick it receives the vectors of its contract
(`vehicle.laws.contract`, `vehicle.estimators.contract`); its answer is used one tick later. A
built-in law or estimator is computed as well in every tick, and `external` notices a plugin that
fails.
"""
