"""The small pages of the sign-in, and their style; all other pages are in `static/`."""

from __future__ import annotations

import base64
import hashlib
from html import escape

from starlette.responses import HTMLResponse

from web.access.roles import Role, Session
from web.theme import TOKENS, html_tag

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; "
    "frame-ancestors 'none'; base-uri 'none'"
)
_SUBMIT = "document.getElementById('by_link').submit()"
_SCRIPT = base64.b64encode(hashlib.sha256(_SUBMIT.encode()).digest()).decode()
LINK_POLICY = f"{POLICY}; script-src 'sha256-{_SCRIPT}'"
_STYLE = """
body{margin:0;min-height:100vh;display:grid;place-items:center;
background:var(--ground);color:var(--text);font:var(--body)/1.55 var(--sans)}
main{max-width:30rem;padding:2rem}h1{font-size:var(--lead);font-weight:600;margin:0 0 1.2rem}
p{margin:.6rem 0;color:var(--dim)}code{color:var(--text);font:var(--note) var(--mono)}
form{display:flex;gap:.5rem;margin:0 0 .4rem}
.people{flex-direction:column;border-bottom:1px solid var(--line);padding-bottom:1.4rem;
margin-bottom:1.1rem}.people button{align-self:flex-start;margin-top:.3rem}
label{display:flex;flex-direction:column;gap:.15rem;color:var(--dim);font-size:var(--note)}
input,button{font:inherit;font-size:var(--body);padding:.42rem .7rem;border:1px solid var(--strong);
border-radius:var(--radius);background:var(--raised);color:var(--text)}input{background:var(--panel);flex:1;min-width:0}
button{cursor:pointer}button:hover{border-color:var(--edge)}
:focus-visible{outline:2px solid var(--accent);outline-offset:1px}
"""

_PASSWORD_FORM = """<form class="people" method="post" action="/login">
<label>Name<input name="name" value="{name}" autocomplete="username" autocapitalize="none"
spellcheck="false" maxlength="64" required{name_focus}></label>
<label>Password<input name="password" type="password" autocomplete="current-password"
maxlength="500" required{password_focus}></label>
<button>Sign in</button></form>"""


def sign_in_page(line: str, name: str, base_url: str, *, with_password: bool) -> str:
    """Return the page that explains how to sign in.

    Args:
        line: why this page is shown.
        name: the name typed at the last attempt.
        with_password: whether there are accounts to sign in to.
    """
    people = ""
    if with_password:
        at_name, at_password = ("", " autofocus") if name else (" autofocus", "")
        people = _PASSWORD_FORM.format(
            name=escape(name[:64]), name_focus=at_name, password_focus=at_password
        )
    focus = "" if with_password else " autofocus"
    return small_page(
        "quadlab: sign in",
        f"""<h1>{escape(line)}</h1>{people}
<p>Open the newest link that quadlab printed in its terminal. It looks like
<code>{escape(base_url)}/?token=…</code>.</p>
<p>When a link has been used, a fresh one for the next browser is printed below it. No terminal
at hand? Ask someone who is signed in for an invitation: <em>Invite</em> on the page.</p>
<form method="post" action="/login"><input name="token" aria-label="token"
placeholder="or paste the token here"
autocomplete="off"{focus}><button>Sign in</button></form>""",
    )


def link_page(token: str) -> HTMLResponse:
    """Return the page of a sign-in link, which posts the token by itself, or by its button where
    scripts are off.

    Opening a link changes nothing, because any page can make a browser open one.
    """
    page = small_page(
        "quadlab: sign in",
        f"""<form id="by_link" method="post" action="/login">{_hidden(token)}
<button>Sign in</button></form><script>{_SUBMIT}</script>""",
    )
    return page_response(page, headers={"content-security-policy": LINK_POLICY})


def replace_page(token: str, session: Session, role: Role) -> str:
    """Return the page that asks whether a link shall replace the session of this browser."""
    who = f"{session.label} ({session.role})" if session.has_account else session.label
    return small_page(
        "quadlab: sign in",
        f"""<h1>You are signed in as {escape(who)}.</h1>
<p>The link that was opened would sign this browser in as {escape(role)} instead.</p>
<form action="/"><button autofocus>Stay {escape(session.label)}</button></form>
<form method="post" action="/login">{_hidden(token)}<input type="hidden" name="replace" value="1">
<button>Sign in as {escape(role)}</button></form>""",
    )


def _hidden(token: str) -> str:
    return f'<input type="hidden" name="token" value="{escape(token)}">'


def signed_in_page() -> str:
    """Return the page that continues to the console by itself.

    It is a page and not a redirect: a browser does not send a SameSite=Strict cookie along a
    redirect that began at another site (a link in a mail), but does on a navigation that begins
    here.
    """
    return small_page(
        "quadlab",
        '<meta http-equiv="refresh" content="0;url=/"><h1>Signed in.</h1>'
        '<p><a href="/" style="color:inherit">Go to the page</a></p>',
    )


def page_response(
    page: str, status: int = 200, headers: dict[str, str] | None = None
) -> HTMLResponse:
    """Return a small page as an answer that is not cached."""
    own = {"content-security-policy": POLICY, "cache-control": "no-store"}
    return HTMLResponse(page, status, {**own, **(headers or {})})


def small_page(title: str, body: str) -> str:
    """Return a complete page; `body` is HTML."""
    return (
        f'<!doctype html>{html_tag()}<meta charset="utf-8"><title>{title}</title>'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{TOKENS}{_STYLE}</style><main>{body}</main></html>"
    )
