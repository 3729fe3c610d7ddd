"""The processes of a test, for which it waits at most so long: one that does not end shows where it waits."""

import os
import signal
import subprocess
import sys
import tempfile


class NodeProcess:
    """A process whose output goes to a file, as a pipe that nobody reads may fill. `add_cleanup` gets what ends it."""

    def __init__(self, command, add_cleanup, environment=os.environ):
        self._command = command
        self._output = tempfile.NamedTemporaryFile("a")
        add_cleanup(self._output.close)
        environment = {**environment, "PYTHONFAULTHANDLER": "1"}  # Python shows its threads at SIGABRT.
        self._process = subprocess.Popen(command, stdout=self._output, stderr=subprocess.STDOUT, env=environment)
        add_cleanup(self._end)

    @property
    def is_alive(self):
        return self._process.poll() is None

    def said(self):
        with open(self._output.name, encoding="utf8", errors="replace") as file:
            return file.read()

    def finish(self, timeout):
        """Waits until the process ends. Returns its exit code and what it has said."""
        try:
            return self._process.wait(timeout), self.said()
        except subprocess.TimeoutExpired:
            self.tell(signal.SIGABRT)
            try:
                self._process.wait(10)
            except subprocess.TimeoutExpired:
                self.kill()
            raise AssertionError(f"{' '.join(self._command)}\ndid not end within {timeout} s. It said:\n{self.said()}") from None

    def tell(self, number):
        self._process.send_signal(number)

    def interrupt(self):
        """Returns the exit code."""
        self.tell(signal.SIGINT)
        return self.finish(60)[0]

    def kill(self):
        self._process.kill()
        self._process.wait()

    def _end(self):
        """A node that is killed stays known to others for a while, so the next test would talk to a ghost."""
        if self.is_alive:
            self.interrupt()


def node_command(module, arguments):
    return [sys.executable, "-m", f"slalom_ros.{module}", *arguments]
