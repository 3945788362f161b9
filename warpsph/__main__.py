"""Lets `python -m warpsph` do what the `warpsph` command does."""

import sys
import time

BEGAN = time.perf_counter()  # before the imports, so that a run can tell how long it took to its first step

from warpsph.cli import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main(began=BEGAN))
