"""A sign-in link in a real browser: one open signs in, and a page of another site gains nothing."""

from __future__ import annotations

from typing import Any

import httpx

EVIL = "http://evil.example/"


def invitation(admin: httpx.Client, role: str) -> str:
    url: str = admin.post("/api/invitations", json={"role": role}).json()["url"]
    return url


def label(page: Any, site: Any) -> str:
    found: str = page.request.get(f"{site.base}/api/session").json()["label"]
    return found


def test_a_link_on_another_site_replaces_no_session_by_itself(
    page: Any, site: Any, context: Any
) -> None:
    before = label(page, site)
    with site.sign_in() as admin:
        url = invitation(admin, "viewer")
    html = f'<img src="{url}"><iframe src="{url}"></iframe><a href="{url}">free coffee</a>'
    context.route(EVIL, lambda route: route.fulfill(body=html, content_type="text/html"))
    page.goto(EVIL)
    page.click("a")
    page.wait_for_selector("text=You are signed in as")
    assert label(page, site) == before
    page.click(f"text=Stay {before}")
    page.wait_for_selector("#behaviors button")
    assert label(page, site) == before


def test_without_scripts_a_button_signs_in_and_the_link_is_not_in_the_history(
    context: Any, site: Any
) -> None:
    with site.sign_in() as admin:
        plain, scripted = invitation(admin, "viewer"), invitation(admin, "viewer")
    guests = context.browser.new_context(java_script_enabled=False)
    guest = guests.new_page()
    guest.goto(plain)
    assert guest.request.get(f"{site.base}/api/session").status == 401
    guest.click("text=Sign in")
    guest.wait_for_url(f"{site.base}/")
    assert label(guest, site).startswith("viewer ")
    guests.close()
    guests = context.browser.new_context()
    guest = guests.new_page()
    guest.goto(scripted)
    guest.wait_for_selector("#behaviors button")
    assert guest.url == f"{site.base}/"
    guest.go_back()
    assert "token" not in guest.url
    guests.close()
