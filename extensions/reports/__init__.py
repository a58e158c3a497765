"""Reports of runs: figures, metrics, parameters and calibrations as one page and a PDF."""
