"""Pages without a browser: what they judge as a browser does, and what they refuse to judge."""

from __future__ import annotations

from typing import Any

import pytest

from tests.web.dom.dom_driver import DomError


@pytest.fixture
def plain(context: Any, site: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a page without scripts, whose waits are short; `show` replaces its body."""
    monkeypatch.setattr("tests.web.dom.dom_page.BOUND", 200)
    page = context.new_page()
    page.goto(f"{site.base}/login")
    return page


def show(page: Any, html: str) -> None:
    page.evaluate("(html) => { document.body.innerHTML = html; }", html)


def test_an_element_is_hidden_by_attribute_parent_or_closed_details(plain: Any) -> None:
    show(
        plain,
        "<p id=a>a</p><p id=b hidden>b</p><div hidden><p id=c>c</p></div>"
        "<details><summary id=d>d</summary><p id=e>e</p></details><dialog id=f>f</dialog>",
    )
    seen = {name: plain.is_visible(f"#{name}") for name in "abcdef"}
    assert seen == {"a": True, "b": False, "c": False, "d": True, "e": False, "f": False}
    plain.click("summary")
    assert plain.is_visible("#e")


def test_an_element_is_hidden_by_the_pages_stylesheets(kept_page: Any) -> None:
    for name, visible in (("good", False), ("bad", True)):
        kept_page.evaluate(
            "(name) => { const place = document.getElementById('answer'); place.hidden = false;"
            " place.className = name; place.querySelector('button').textContent = 'x'; }",
            name,
        )
        assert kept_page.is_visible("#answer button") is visible
    kept_page.evaluate("document.getElementById('answer').hidden = true")
    assert kept_page.is_hidden(".controls .rule ~ .none")


def test_what_only_a_layout_would_tell_is_refused(plain: Any) -> None:
    show(plain, "<p id=empty></p><p id=both>a<b>b</b></p>")
    with pytest.raises(DomError, match=r"cannot judge whether .*empty"):
        plain.is_visible("#empty")
    with pytest.raises(DomError, match="does not lay out"):
        plain.inner_text("#both")
    with pytest.raises(DomError, match="locators have no bounding_box"):
        plain.locator("#both").bounding_box()
    with pytest.raises(DomError, match="what Tab does in a browser"):
        plain.keyboard.press("Tab")
    with pytest.raises(DomError, match="tells no download"):
        plain.on("download", print)
    assert not hasattr(plain, "screenshot")


def test_nobody_clicks_or_fills_what_is_hidden_or_disabled(plain: Any) -> None:
    show(plain, "<button disabled>a</button><input hidden><button hidden id=b>b</button>")
    with pytest.raises(DomError, match="it is disabled"):
        plain.click("button >> nth=0")
    with pytest.raises(DomError, match="it is not visible"):
        plain.click("#b")
    with pytest.raises(DomError, match="it is not visible"):
        plain.fill("input", "x")
    with pytest.raises(DomError, match="there is none"):
        plain.click("#c")


def test_a_selector_finds_what_playwrights_does(plain: Any) -> None:
    show(
        plain,
        "<ul><li>one <i>x</i></li><li>One more <i>y</i></li><li hidden>none</li></ul>"
        "<button>Go</button><button>Go on</button>",
    )
    assert plain.locator("li:has-text('one')").count() == 3
    assert plain.locator("button:text-is('Go')").count() == 1
    assert plain.locator("ul >> text=More").count() == 1
    assert plain.text_content("li:has-text('more') i") == "y"
    assert plain.locator("li >> visible=true").count() == 2
    assert plain.text_content("li:visible >> nth=-1") == "One more y"
    with pytest.raises(DomError, match="li is not one element but 3"):
        plain.locator("li").text_content()
    with pytest.raises(DomError, match="no selector engine for xpath="):
        plain.locator("xpath=//li").count()
    with pytest.raises(DomError, match="does not know a part of"):
        plain.locator("li:right-of(i)").count()


def test_a_field_tells_its_change_when_it_is_left_and_keys_repeat(plain: Any) -> None:
    show(plain, "<input id=a><input id=b>")
    plain.evaluate(
        """() => { window.seen = [];
        for (const type of ['input', 'change', 'keydown']) document.addEventListener(type,
          (event) => seen.push(type + (event.key ?? '') + (event.repeat ? ' again' : ''))); }"""
    )
    plain.fill("#a", "x")
    plain.focus("#b")
    for _ in range(2):
        plain.keyboard.down("m")
    plain.keyboard.up("m")
    assert plain.evaluate("seen") == ["input", "change", "keydownm", "keydownm again"]


def test_an_error_of_a_script_fails_the_test_that_does_not_expect_it(
    context: Any, site: Any
) -> None:
    other = context.another()
    page = other.new_page()
    page.goto(f"{site.base}/login")
    page.evaluate("void setTimeout(() => { throw new Error('of a timer'); })")
    page.evaluate("void Promise.reject(new Error('of a promise'))")
    page.evaluate("void document.createElement('canvas').getContext('2d').fill()")
    with pytest.raises(DomError, match="draws nothing: getImageData has no answer"):
        page.evaluate("document.createElement('canvas').getContext('2d').getImageData(0, 0, 1, 1)")
    page.evaluate("new Promise((done) => setTimeout(done, 20))")
    with pytest.raises(DomError, match=r"(?s)of a (timer|promise).*of a (timer|promise)"):
        other.close()
