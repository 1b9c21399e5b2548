"""A process that keeps records: ``python -m tests.store.writer PLACE FIRST LAST [BYTES [STEP]]``.

With STEP it keeps so many at a time, and says the last one of each block once it is kept.
"""

from __future__ import annotations

import resource
import signal
import sys

from mlg_troubleshoot.store import Store, StoreError

from . import places

if __name__ == "__main__":
    place, *numbers = sys.argv[1:]
    first, last, most, step = [*map(int, numbers), 0, 0][:4]
    step = step or last - first
    blocks = [places.records(at, min(at + step, last)) for at in range(first, last, step)]
    store = Store(place)
    if most:
        # No file may grow beyond this: to the database the same as a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    print("ready", flush=True)
    try:
        for number, block in enumerate(blocks, 1):
            store.add(block)
            print(number, flush=True)
    except StoreError as error:
        print(error.message, flush=True)
        sys.exit(5)
