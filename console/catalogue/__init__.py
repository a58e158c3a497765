"""The catalogue of runs: an SQLite database in the data folder, or a server by URL."""
