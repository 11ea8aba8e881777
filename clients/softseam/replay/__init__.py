"""Recordings in rerun: the only package that imports it.

>>> from softseam.replay import replay
>>> replay("run.mcap", save="run.rrd")
"""

from softseam.replay.show import ReplayError, replay
from softseam.replay.verify import Verification, verify

__all__ = ["ReplayError", "Verification", "replay", "verify"]
