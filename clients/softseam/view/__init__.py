"""What replays and pictures draw: arrays in, arrays out. Needs numpy only."""
