"""`quadlab replay`: runs estimators again over a recorded flight."""
