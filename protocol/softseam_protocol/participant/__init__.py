"""Anybody's solver as a participant: the order of requests, what a simple solver need not write, the process."""
