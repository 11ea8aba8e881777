"""The protocol's test kit: `softseam conform ENDPOINT` runs its checks against a participant on the bus.

`table.py` names every check; one file holds those of a theme. `part.py` is what they ask with: a block of two cells.
"""
