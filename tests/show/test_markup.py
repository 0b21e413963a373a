from html.parser import HTMLParser

from armdyn.show.markup import Html, element, fill, inline_svg, join, table

EVIL = "</td><script>alert('x')</script>&\""


class Reader(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.text, self.attributes = [], [], {}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes |= dict(attrs)

    def handle_data(self, data):
        self.text.append(data)


def test_text_is_escaped_and_markup_is_not():
    seen = Reader(element("p", EVIL, element("b", "bold"), title=EVIL, class_="x", aria_label="y"))
    assert seen.tags == ["p", "b"]
    assert "".join(seen.text) == EVIL + "bold"
    assert seen.attributes == {"title": EVIL, "class": "x", "aria-label": "y"}


def test_join():
    assert join(["a<", Html("<br>"), "b"]) == "a&lt;<br>b"
    assert isinstance(join(["a"]), Html)


def test_table_scrolls_and_has_a_head():
    seen = Reader(table([[element("th", "a")]], [[element("td", EVIL)], [element("td", "2")]]))
    assert seen.tags == ["div", "table", "thead", "tr", "th", "tbody", "tr", "td", "tr", "td"]
    assert EVIL in "".join(seen.text)


def test_fill_is_one_pass():
    assert fill("{{a}} {{b}}", {"a": "{{b}}", "b": "\\1{{a}}"}) == "{{b}} \\1{{a}}"


def test_inline_svg_has_own_ids_no_links_and_the_pages_colours():
    text = (
        '<?xml version="1.0"?><!DOCTYPE svg><svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://x" width="1" '
        'version="1.1"><metadata><a href="http://m"/></metadata><defs><path id="p"/></defs>'
        '<use xlink:href="#p" style="stroke: #30363d"/><g clip-path="url(#q)"/></svg>'
    )
    svg = inline_svg(text, "f2", 'a "figure"', {"#30363d": "var(--ink)"})
    assert "http" not in svg and "metadata" not in svg
    assert 'id="f2-p"' in svg and 'href="#f2-p"' in svg and "url(#f2-q)" in svg
    assert "stroke: var(--ink)" in svg
    assert svg.startswith('<svg role="img" aria-label="a &quot;figure&quot;"')


def test_ids_of_an_svg_that_nothing_refers_to_go():
    text = '<svg width="1"><path id="switch"/><path id="switch"/><path id="p"/><use href="#p"/></svg>'
    svg = inline_svg(text, "f2", "figure", {})
    assert "switch" not in svg and svg.count('id="f2-p"') == 1 and svg.count("<path") == 3
