"""Pages of docs/reference/ that are made from the code, and the drawings of docs/concepts/."""
