"""FMUs: laws and estimators from files of FMI 2 and 3, and our plant and law as such files."""
