"""What takes a service's messages."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from aerojax.serve.figures import Health
from aerojax.serve.messages import Message, Sighting


@runtime_checkable
class Sink(Protocol):
    """Takes messages in order, from one thread; never waits long."""

    name: str
    """For messages and counts."""
    vital: bool
    """Whether a service whose messages it cannot take any more has nothing left to do."""

    def send(self, message: Message, sighting: Sighting | None) -> None:
        """Take a message; `sighting` is what it was made of where it tells of an object.

        Raises:
            OSError: it could not be taken; it is lost, and the next one may be sent.
        """
        ...

    def see(self, health: Health) -> None:
        """Take the newest figures, a few times a second."""
        ...

    def close(self) -> None:
        """Give everything away and end; called once."""
        ...
