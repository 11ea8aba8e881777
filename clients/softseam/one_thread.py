"""A session is for one thread at a time: a second one is refused before its requests mix with the first one's."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from softseam.errors import BadInput

Method = TypeVar("Method", bound=Callable[..., Any])


def one_thread(method: Method) -> Method:
    """A method that is refused while another thread is in one of this kind; the object has an RLock `_turn`."""

    @wraps(method)
    def call(self: Any, *args: Any, **kwargs: Any) -> Any:
        turn = self._turn
        if not turn.acquire(blocking=False):
            raise BadInput(
                "another thread is at work in this session, which is for one thread at a time: open a session for each "
                "thread, or let them share a lock"
            )
        try:
            return method(self, *args, **kwargs)
        finally:
            turn.release()

    return cast(Method, call)
