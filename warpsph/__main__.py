"""Lets `python -m warpsph` do what the `warpsph` command does."""

import sys
import time

BEGAN = time.perf_counter()  # before the imports, so that a run can tell how long it took to its first step

import warpsph  # noqa: E402

if not hasattr(warpsph, "__version__"):  # beside the caller lies a folder named warpsph, such as a clone
    place = next(iter(warpsph.__path__), "warpsph")
    print(f"{place}: this folder hides the package warpsph; call it from another folder", file=sys.stderr)
    sys.exit(2)


def start() -> int:
    """What the command `warpsph` does, too; stopped while it is still being loaded, it says so in a line."""
    try:
        from warpsph.signals import held

        with held():
            from warpsph.cli import main
        return main(began=BEGAN)
    except KeyboardInterrupt:
        print("stopped from the keyboard", file=sys.stderr)
        return 5


if __name__ == "__main__":
    sys.exit(start())
