"""The fuzz of commands; see ``tests/fuzz_commands.py``."""

from __future__ import annotations

import os

# Before numpy comes: each case is a child, and threads of the maths library cost it more than they
# bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
