"""Training and judging policies, with stable-baselines3."""
