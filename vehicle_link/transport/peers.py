"""The nodes at the other end of a session's radio link."""

from __future__ import annotations

import zenoh


def namespaces(session: zenoh.Session, timeout: float = 1.0) -> set[str]:
    """Return the namespaces of the nodes there (`quad1`) that this session may see; asks over the
    link.
    """
    found: set[str] = set()
    try:
        links = session.info.links()
        for zid in {str(link.zid) for link in links if link.dst.startswith("quic/")}:
            for reply in session.liveliness().get(f"@ros2_lv/*/{zid}/**", timeout=timeout):
                if reply.ok is not None:
                    # @ros2_lv/domain/session/node/endpoint/kind/enclave/namespace/…
                    found.add(str(reply.ok.key_expr).split("/")[7].strip("%"))
    except zenoh.ZError:  # closed in the meantime
        return set()
    return found - {""}
