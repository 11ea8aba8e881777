"""What a run's quantities are claimed to be off by: its difference to a sibling run, times a factor."""
