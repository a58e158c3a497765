"""The actions of `quadlab link`."""
