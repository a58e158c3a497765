"""Ways to return unused memory to the system while a station dials without an answer."""

from __future__ import annotations

import ctypes

M_MMAP_THRESHOLD = -3
"""Option of mallopt, from /usr/include/malloc.h."""
LARGE = 1 << 20  # B


def map_large_buffers() -> bool:
    """Allocate each buffer of 1 MiB or more as a separate mapping, returned when it is freed.

    Each attempt to dial in vain allocates a receive buffer of 3 MB in QUIC's endpoint (quinn), most
    of it never touched, and about nine attempts are alive during an outage. glibc takes such
    buffers from its heap once the first has been freed, zeroes them, and keeps the touched pages:
    29 MB more after the first long outage. Applies to the whole process; may be called at any time
    and repeatedly.

    Returns:
        False if the C library has no mallopt.
    """
    library = ctypes.CDLL(None)
    return hasattr(library, "mallopt") and bool(library.mallopt(M_MMAP_THRESHOLD, LARGE))


def trim_heaps() -> bool:
    """Return whole free pages inside the heaps to the system; takes 0.2 to 2 ms.

    glibc has one heap for every few threads and returns only what is at a heap's end. Sixty outages
    left 6 MB of free pages in them, which were never used again.

    Returns:
        False if nothing could be returned, or the C library has no malloc_trim.
    """
    library = ctypes.CDLL(None)
    return hasattr(library, "malloc_trim") and bool(library.malloc_trim(0))
