"""The estimators on board: what feeds them, which one is flown on, how they are watched."""
