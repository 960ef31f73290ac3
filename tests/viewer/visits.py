"""Visits to a page, by hand."""

import http.client


def get(port, path="/", **headers):
    """Status, headers and body of the answer to a plain request on this machine."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        connection.close()


def gone(peer):
    """Whether the server has hung up on a socket, within the socket's own time limit."""
    try:
        while peer.recv(2**20):
            pass
    except ConnectionError:
        pass
    except TimeoutError:
        return False
    return True


def send_often(peer, frame, times):
    """Send a frame again and again, and read nothing."""
    for _ in range(times):
        peer.sendall(frame)
