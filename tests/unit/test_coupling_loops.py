"""Every coupling loop, with parts whose answers are known: how it goes on from what it saved, and who is refused."""

from __future__ import annotations

import numpy as np
import pytest
from known_parts import Chain, part, seam

from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.loop import Unsuited

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("scheme", list(LOOPS))
def test_a_loop_goes_on_from_its_arrays_before_or_after_it_begins(scheme: str) -> None:
    one = Chain({"a": part(1), "b": part(2)}, [seam("a", "b")], build=LOOPS[scheme])
    for _ in range(4):
        one.step()
    arrays = one.loop.to_arrays()
    for begins_first in (True, False):
        other = LOOPS[scheme](one.setup)
        if begins_first:
            other.begin(one.able)
        other.take(arrays)
        if not begins_first:
            other.begin(one.able)
        np.testing.assert_array_equal(other.multipliers(), one.loop.multipliers())
        for name, array in other.to_arrays().items():
            np.testing.assert_array_equal(array, arrays[name])
        with pytest.raises(KeyError):
            other.take({})


def test_staggered_is_of_two_parts_one_of_which_it_can_put() -> None:
    build = LOOPS["staggered"]
    three, two = [seam("a", "m"), seam("m", "b", at=(3, 0))], [seam("a", "b")]
    with pytest.raises(Unsuited, match=r"two parts at one interface, not 3 at 2: use seam: {scheme: position}"):
        Chain({"a": part(1), "m": part(3, 6), "b": part(2)}, three, build=build)
    with pytest.raises(Unsuited, match="puts all coupling nodes of 'a', of which this interface has some only"):
        Chain({"a": part(1, 5), "b": part(2)}, two, build=build)
    with pytest.raises(Unsuited, match="part 'a' reports no compliance"):
        Chain({"a": part(1, tells=False), "b": part(2)}, two, build=build)
    Chain({"a": part(1), "b": part(2, tells=False)}, two, build=build).step()  # it asks part a alone
