"""`python -m softseam`, the same as the command `softseam`."""

from softseam.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
