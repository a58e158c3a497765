"""The base station: records, checks, commands and judges, for one or several vehicles."""
