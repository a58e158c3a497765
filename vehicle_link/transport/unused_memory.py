"""Return unused memory to the system while a station dials without an answer."""

from __future__ import annotations

import ctypes

M_MMAP_THRESHOLD = -3
"""Option of mallopt, from /usr/include/malloc.h."""
LARGE = 1 << 20  # B


def keep_large_buffers_apart() -> bool:
    """Let each buffer of 1 MiB or more be a mapping of its own, given back when it is freed.

    Each vain attempt to dial takes a receive buffer of 3 MB in QUIC's endpoint (quinn), most of it
    never touched, and some nine attempts are alive during an outage. glibc takes such buffers from
    its heap once the first has been freed, zeroes them, and keeps what they touched: + 29 MB after
    the first long outage. For the whole process, at any time and as often as one likes.

    Returns:
        False where the C library has no mallopt.
    """
    library = ctypes.CDLL(None)
    return hasattr(library, "mallopt") and bool(library.mallopt(M_MMAP_THRESHOLD, LARGE))


def give_back_what_is_free() -> bool:
    """Give whole free pages inside the heaps back; takes 0.2 to 2 ms.

    glibc has a heap for each few threads and gives back only what lies at a heap's end. Sixty
    outages left 6 MB of free pages in them, which nothing asked for again.

    Returns:
        False where nothing could be given back, or the C library has no malloc_trim.
    """
    library = ctypes.CDLL(None)
    return hasattr(library, "malloc_trim") and bool(library.malloc_trim(0))
