"""One file an acceleration: how the next multiplier is found where no part tells how it yields."""
