"""The documents served by the page itself, and a search of everything that a page knows."""
