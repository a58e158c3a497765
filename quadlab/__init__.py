"""The command line: composition of vehicle, station, web and simulator. One file a command."""

import os

# Matrices here are small: a second thread of numpy's library would only be idle, in every process.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
