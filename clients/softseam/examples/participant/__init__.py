"""A participant of its own: a linear block that takes a part of a body over the bus, without any solver of softseam.

python -m softseam.examples.participant [--connect ENDPOINT] [--service NAME] [--deployment NAME]

Copy this folder to begin with one of yours: `block.py` is the mechanics, `__main__.py` puts it on the bus.
"""
