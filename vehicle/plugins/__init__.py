"""Users' own control laws, estimators and behaviors: files of the folder `plugins`, packages,
UDP programs.

A plugin runs in a process of its own. In each tick it receives the vectors of its contract
(`vehicle.laws.contract`, `vehicle.estimators.contract`, `vehicle.behaviors.contract`); its answer
is used one tick later. A built-in law or estimator is computed as well in every tick, a behavior's
vehicle brakes and hovers; `external` notices a plugin that fails.
"""
