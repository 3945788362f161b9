"""Lets `python -m warpsph` do what the `warpsph` command does."""

import sys

from warpsph.cli import main

if __name__ == "__main__":
    sys.exit(main())
