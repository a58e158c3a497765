"""The estimators on board: what each is fed with, which one is flown on, and how they are watched."""
