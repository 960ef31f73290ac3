"""A session's page, served on a thread of its own."""

import asyncio
import threading
from contextlib import contextmanager

from stc.steering.server import Server


@contextmanager
def served(session, told):
    """The address of a session's page, while it is served."""
    server = Server(session)
    told.append(server.told)
    ready, found = threading.Event(), []

    def work():
        asyncio.run(server.run(0, lambda address: (found.append(address), ready.set())))

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    assert ready.wait(30.0)
    try:
        yield found[0]
    finally:
        server.stop()
        thread.join(30.0)
        assert not thread.is_alive()
