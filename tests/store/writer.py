"""A process that keeps records: ``python -m tests.store.writer PLACE FIRST LAST [BYTES]``."""

from __future__ import annotations

import resource
import signal
import sys

from mlg_troubleshoot.store import Store, StoreError

from . import places

if __name__ == "__main__":
    place, first, last, *most = sys.argv[1:]
    batch = places.records(int(first), int(last))
    store = Store(place)
    if most:
        # No file may grow beyond this: to the database the same as a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(most[0]), int(most[0])))
    print("ready", flush=True)
    try:
        store.add(batch)
    except StoreError as error:
        print(error.message, flush=True)
        sys.exit(5)
