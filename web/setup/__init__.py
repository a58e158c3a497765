"""The Set-up page: what this station has, who may use it, and whether all is as it should be."""
