"""Invitations as a link and as a QR code, which OpenCV reads."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pytest

from web.access.invitation_link import link_and_code

TOKEN = "?token=0123456789abcdefABCDEF_-0123"


@pytest.mark.parametrize("base", ["https://192.168.7.30:8080/", "https://[fd00::17]:8443/"])
def test_the_qr_code_of_a_link_is_the_link(base: str) -> None:
    found = link_and_code(base + TOKEN)
    assert (found["url"], found["here_only"]) == (base + TOKEN, False)
    kind, _, content = str(found["picture"]).partition(",")
    assert kind == "data:image/png;base64"
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(content), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert cv2.QRCodeDetectorAruco().detectAndDecode(picture)[0] == base + TOKEN


@pytest.mark.parametrize("base", ["http://127.0.0.1:8080/", "http://localhost/", "http://[::1]:9/"])
def test_a_link_that_no_other_computer_reaches_says_so(base: str) -> None:
    assert link_and_code(base + TOKEN) == {"url": base + TOKEN, "here_only": True, "picture": ""}
