"""The broker where there is no mosquitto: amqtt on the loopback, MQTT 3.1.1. `python -m` this module PORT."""

from __future__ import annotations

import asyncio
import logging
import sys

from amqtt.broker import Broker  # type: ignore[import-untyped]  # amqtt has no types

CONFIGURATION = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}


async def serve(port: int) -> None:
    """Serve until killed; it keeps nothing on disk, so there is nothing to end in order."""
    logging.getLogger("transitions").setLevel(logging.WARNING)
    broker = Broker({"listeners": {"default": {"type": "tcp", "bind": f"127.0.0.1:{port}"}}, "plugins": CONFIGURATION})
    await broker.start()
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1])))
