"""`quadlab replay`: other estimators over a recorded flight."""
