"""An extension for services: the kinds of interface of `joining`."""

from __future__ import annotations

import joining

joining.add()
