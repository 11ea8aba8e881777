"""The least that a scene needs: the cheapest way to simulate it within a tolerance, found by trying."""
