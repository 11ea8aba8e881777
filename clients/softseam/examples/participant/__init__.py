"""A participant of its own: a linear block that takes a part of a body over the bus, without any solver of softseam.

python -m softseam.examples.participant

Copy this folder to begin with one of yours: `block.py` is the mechanics, `requests.py` answers requests in order, and
`__main__.py` is the process on the bus.
"""
