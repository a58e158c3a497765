"""Formations in real time: the programs of all vehicles beside the page, steered by a person."""
