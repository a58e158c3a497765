"""The link to one vehicle: what is received, what is sent, how good it is, who may command."""
