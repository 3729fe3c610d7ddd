"""A TCP proxy for drills: between a role and a server, with delays, stalls, one-way cuts, resets and damaged bytes."""

import collections
import select
import socket
import struct
import threading
import time

CHUNK = 1 << 18
MOST_QUEUED = 4 << 20  # Of one direction; then it reads no more, as a full router would.


class Pipe:
    """One direction of a connection."""

    def __init__(self, source, target):
        self.source, self.target = source, target
        self.queue = collections.deque()  # Pairs: when the bytes are due, bytes.
        self.queued = 0


class Link:
    """A listener whose connections lead to 127.0.0.1:`port`. What a drill sets holds for all of them, from the next moment on."""

    def __init__(self, port):
        self.target = port
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.setblocking(False)
        self.port = self.listener.getsockname()[1]
        self.connections = []  # Pairs of pipes: to the server, from the server.
        self.delay = 0.0  # Seconds.
        self.stalled = ()  # Of "to" and "from": directions in which nothing gets through.
        self.reset = self.damage = False  # Once.

    def calm(self):
        self.delay, self.stalled = 0.0, ()


class Proxy:
    """The links of a drill, in one thread, until it ends."""

    def __init__(self):
        self.links = []
        self.stopping = False
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def add(self, port):
        link = Link(port)
        self.links.append(link)
        return link

    def close(self):
        self.stopping = True
        self.thread.join()

    def run(self):
        while not self.stopping:
            self.turn()
        for link in self.links:
            link.listener.close()
            for connection in list(link.connections):
                end(link, connection)

    def turn(self):
        readers, writers, now = {}, {}, time.monotonic()
        for link in list(self.links):
            readers[link.listener] = (link, None, None)
            if link.reset:
                link.reset = False
                for connection in list(link.connections):
                    end(link, connection, rudely=True)
            for connection in link.connections:
                for name, pipe in zip(("to", "from"), connection):
                    if name in link.stalled:
                        continue
                    if pipe.queued < MOST_QUEUED:
                        readers[pipe.source] = (link, connection, pipe)
                    if pipe.queue and pipe.queue[0][0] <= now:
                        writers[pipe.target] = (link, connection, pipe)
        readable, writable, _ = select.select(list(readers), list(writers), [], 0.01)
        gone = set()
        for ready, known, act in ((readable, readers, self.read), (writable, writers, self.write)):
            for item in ready:
                link, connection, pipe = known[item]
                if id(connection) in gone:
                    continue
                try:
                    act(link, connection, pipe)
                except BlockingIOError:
                    pass
                except OSError:
                    gone.add(id(connection))
                    end(link, connection)

    @staticmethod
    def read(link, connection, pipe):
        if connection is None:
            client, _ = link.listener.accept()
            try:
                server = socket.create_connection(("127.0.0.1", link.target), timeout=1.0)
            except OSError:
                client.close()
                return
            for end_point in (client, server):
                end_point.setblocking(False)
                end_point.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link.connections.append((Pipe(client, server), Pipe(server, client)))
            return
        data = pipe.source.recv(CHUNK)
        if not data:
            raise ConnectionError
        if link.damage:
            link.damage = False
            data = data[:len(data) // 2] + bytes([data[len(data) // 2] ^ 1]) + data[len(data) // 2 + 1:]
        pipe.queue.append((time.monotonic() + link.delay, data))
        pipe.queued += len(data)

    @staticmethod
    def write(_, __, pipe):
        due, data = pipe.queue[0]
        sent = pipe.target.send(data)
        pipe.queued -= sent
        if sent < len(data):
            pipe.queue[0] = (due, data[sent:])
        else:
            pipe.queue.popleft()


def end(link, connection, rudely=False):
    if connection not in link.connections:
        return
    link.connections.remove(connection)
    for pipe in connection:
        if rudely:  # By RST, with what is under way lost.
            pipe.source.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        pipe.source.close()
