"""``mlg`` without its start: a server that has imported the package runs each command in a child.

A page of the documentation runs many commands; most of the time of each is that of its imports.
"""

from __future__ import annotations

import array
import atexit
import marshal
import os
import select
import socket
import subprocess
import sys
import tempfile
import traceback
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Hands its arguments, folder, environment and streams over, and ends as the child does.
_CLIENT = """#!{python} -IS
import marshal, os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    asked = marshal.dumps((sys.argv[1:], os.getcwd(), dict(os.environ)))
    socket.send_fds(server, [asked], [0, 1, 2])
    sys.exit(int(server.recv(9) or 99))
"""


@cache
def folder_of_mlg() -> str:
    """Start the server; the folder in which ``mlg`` is its client. Both go with this process."""
    scratch = tempfile.TemporaryDirectory()
    folder = Path(scratch.name)
    client = folder / "mlg"
    address = str(folder / "socket")
    client.write_text(_CLIENT.format(python=sys.executable, address=address), encoding="utf-8")
    client.chmod(0o755)
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.warm_mlg", address],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdout.readline()

    def end() -> None:
        server.communicate()
        scratch.cleanup()

    atexit.register(end)
    return scratch.name


def serve(address: str) -> None:
    """Run each command in a child, until whoever started this closes its standard input."""
    from tests.fuzz.case import preload

    preload()
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(address)
        door.listen()
        print("ready", flush=True)
        while sys.stdin not in select.select([door, sys.stdin], [], [])[0]:
            asked, _ = door.accept()
            with asked:
                if os.fork() == 0:
                    door.close()
                    _become_mlg(asked)
            while _a_child_has_ended():
                pass


def _a_child_has_ended() -> bool:
    try:
        return os.waitpid(-1, os.WNOHANG)[0] > 0
    except ChildProcessError:
        return False


def _become_mlg(asked: socket.socket) -> None:
    """Take over the streams, folder and environment of the client; never returns."""
    from mlg_troubleshoot.cli import main

    code = 99
    try:
        words, streams, _, _ = socket.recv_fds(asked, 1_000_000, 3)
        arguments, folder, environment = marshal.loads(words)
        for old, new in zip(array.array("i", streams), (0, 1, 2), strict=True):
            os.dup2(old, new)
            os.close(old)
        for number, name in enumerate(("stdin", "stdout", "stderr")):
            mode = "w" if number else "r"
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        sys.argv = ["mlg", *arguments]
        try:
            main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:  # noqa: BLE001 - a child says what happened and never goes on as its parent
        os.write(2, traceback.format_exc().encode("utf-8", "replace"))
    finally:
        asked.sendall(str(code).encode())
        os._exit(code)


if __name__ == "__main__":
    serve(sys.argv[1])
