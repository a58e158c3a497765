"""The two small pages shown at the door; all else is in `static/`."""

from __future__ import annotations

_STYLE = """
html{color-scheme:dark}body{margin:0;min-height:100vh;display:grid;place-items:center;
background:#101418;color:#d7dde3;font:15px/1.55 system-ui,sans-serif}
main{max-width:31rem;padding:2rem}h1{font-size:1.25rem;font-weight:600;margin:0 0 .75rem}
p{margin:.6rem 0;color:#9aa5b1}code{color:#d7dde3;font-size:.92em}
form{display:flex;gap:.5rem;margin-top:1.4rem}
input,button{font:inherit;padding:.45rem .7rem;border:1px solid #2c3640;border-radius:6px;
background:#171d23;color:inherit}input{flex:1;min-width:0}button{cursor:pointer}
"""

_REASONS = {
    None: "You are not signed in here.",
    "used": "This sign-in link has been used; each one signs in one browser.",
    "wrong": "This sign-in link is not valid (any more).",
}


def sign_in_page(reason: str | None) -> str:
    """What to do without a session; `reason` is None, "used" or "wrong"."""
    return _page(
        "quadlab: sign in",
        f"""<h1>{_REASONS[reason]}</h1>
<p>Open the newest link that quadlab printed in its terminal. It looks like
<code>http://127.0.0.1:…/?token=…</code>.</p>
<p>When a link has been used, a fresh one for the next browser is printed below it. No terminal
at hand? Ask someone who is signed in for an invitation: <em>Invite</em> on the page's bar.</p>
<form action="/"><input name="token" aria-label="token" placeholder="or paste the token here"
autocomplete="off" autofocus><button>Sign in</button></form>""",
    )


def signed_in_page() -> str:
    """Goes on to the page by itself.

    A page and not a redirect: a SameSite=Strict cookie is not sent along a redirect that
    began at another site (a link in a mail), but is on a navigation that begins here.
    """
    return _page(
        "quadlab",
        '<meta http-equiv="refresh" content="0;url=/"><h1>Signed in.</h1>'
        '<p><a href="/" style="color:inherit">Go to the page</a></p>',
    )


def _page(title: str, body: str) -> str:
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{_STYLE}</style><main>{body}</main></html>"
    )
