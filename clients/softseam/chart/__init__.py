"""Accuracy against speed: a scene's reference, a sweep of methods, and the chart of both."""
