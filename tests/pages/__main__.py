"""Writes the generated pages: `make pages`, or `PYTHONPATH=tests python -m pages`."""

from __future__ import annotations

from pages.written import write

if __name__ == "__main__":
    for path in write():
        print(path)
