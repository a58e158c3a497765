"""Run mypy with the words given, and collect its garbage less often.

mypy collects after each 200,000 new objects, which takes a third of its time on this project.
"""

import gc

from mypy.__main__ import console_entry

gc.set_threshold(2_000_000, 10, 1000)
gc.set_threshold = lambda *_: None  # mypy sets its own
console_entry()
