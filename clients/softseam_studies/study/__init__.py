"""A study of a scene: many ways to simulate it, each held against a reference. A chart draws it, a plan picks of it."""
