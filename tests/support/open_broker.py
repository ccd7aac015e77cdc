"""A plugin of amqtt's broker that lets everybody in; its own would need packages for passwords."""

from __future__ import annotations

from amqtt.plugins.base import BaseAuthPlugin


class Open(BaseAuthPlugin):
    """Whoever comes."""

    async def authenticate(self, *, session) -> bool:
        return True
