"""Stability where methods fail: maps of short runs, each judged, and the textbook's pitfalls with their remedies."""
