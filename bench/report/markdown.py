# SPDX-License-Identifier: Apache-2.0
"""The page's words and tables as Markdown, without plots, pictures and commands: figures.md, tables of documents."""
import html.parser
import re

from scenes import Failure

VOID = {"meta", "img", "input", "br", "link"}
LEFT_OUT = {"svg", "aside", "script", "style", "img", "input", "nav"}
HEADS = {"h2": "## ", "h3": "### ", "h4": "#### "}
COMMANDS, FIGURES = "commands and rows", "figures"  # summaries: of what is left out, of what needs no head


class Tree(html.parser.HTMLParser):
    """(tag, children); a child is a text or a tree. `named`: nodes by their id; "table", "lead": the first of these."""

    def __init__(self, text):
        super().__init__()
        self.root, self.named = ("", []), {}
        self.stack = [self.root]
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        of = dict(attrs)
        # words about a plot go with it
        node = ({"span": "aside"}.get(tag, "svg") if of.get("class") == "plot" else tag, [])
        for name in (of.get("id"), tag if tag == "table" else None, "lead" if of.get("class") == "lead" else None):
            self.named.setdefault(name, node)
        self.stack[-1][1].append(node)
        if tag not in VOID:
            self.stack.append(node)

    def handle_endtag(self, tag):
        self.stack.pop()

    def handle_data(self, data):
        self.stack[-1][1].append(data)


def words(node):
    """Within a line."""
    if isinstance(node, str):
        return re.sub(r"\s+", " ", node).replace("l_inf", "`l_inf`").replace("|", r"\|")
    tag, children = node
    if tag in LEFT_OUT:
        return ""
    text = re.sub(" +", " ", "".join(words(c) for c in children))
    around = {"b": "**{}**", "code": "`{}`", "small": " {}"}.get(tag)
    return around.format(text.strip()) if around else text


def found(node, tag):
    if isinstance(node, str):
        return []
    return [node] if node[0] == tag else [n for c in node[1] for n in found(c, tag)]


def table(node):
    head, *rows = [[words(c).strip() for c in r[1] if not isinstance(c, str)] for r in found(node, "tr")]
    numeric = [all(not r[i] or re.match(r"[-+*–]*\d|–$", r[i]) for r in rows) for i in range(len(head))]
    rows = [head, ["---:" if n else "---" for n in numeric], *rows]
    return "\n".join("| " + " | ".join(r) + " |" for r in rows)


def blocks(node):
    """Paragraphs, heads, lists and tables, in order."""
    out, line = [], ""
    for child in node[1] + [("", [])]:
        tag = "" if isinstance(child, str) else child[0]
        if isinstance(child, str) or tag in ("b", "code", "small", "span", "aside", "data", "a"):
            line += words(child)
            continue
        if line.strip():
            out.append(line.strip())
        line = ""
        if tag in HEADS:
            out.append(HEADS[tag] + words(child).strip())
        elif tag == "table":
            out.append(table(child))
        elif tag == "ul":
            out.append("\n".join("- " + words(c).strip() for c in child[1] if not isinstance(c, str)))
        elif tag == "details" and words(found(child, "summary")[0]) == COMMANDS or \
                tag == "summary" and words(child) == FIGURES or \
                tag == "figure" and found(child, "img") and not found(child, "table"):
            continue
        elif tag and tag not in LEFT_OUT:
            out += blocks(child)
    return out


def markdown(text):
    return "\n\n".join(blocks(Tree(text).root))


def document(a, sections):
    """docs/figures.md; sections as for the page, but for those that are pictures."""
    head = f"""# Figures of the report

Written by `./report --scenes FOLDER` as `figures.md`, from the rows of which its page is made: the page has plots and
pictures besides, and says for each number which row it is.
[report.md](report.md) explains what is measured and how. Machine: {a.machine}. {a.written}."""
    return "\n\n".join([head, *(f"## {title}\n\n{markdown(inside)}" for anchor, title, inside in sections
                                if anchor not in ("pictures", "seeing"))]) + "\n"


def fill(path, sections):
    """Puts sections into a document, between `<!-- report: SECTION -->` and `<!-- end of report -->`; of
    `SECTION, NAME` a table (its id; `table`: the first one) or the `lead` alone."""
    with open(path) as f:
        page = f.read()
    parts = re.split(r"(<!-- report: ([\w-]+)(?:, ([\w-]+))? -->\n)(.*?)(<!-- end of report -->)", page,
                     flags=re.DOTALL)
    if len(parts) == 1:
        raise Failure(f"{path}: no '<!-- report: SECTION -->' and '<!-- end of report -->' in it")
    inside = {anchor: text for anchor, _, text in sections}
    for i in range(1, len(parts), 6):
        anchor, name = parts[i + 1:i + 3]
        if anchor not in inside:
            raise Failure(f"{path}: no section {anchor} in the report")
        tree = Tree(inside[anchor])
        if name and name not in tree.named:
            raise Failure(f"{path}: no {name} in section {anchor} of the report")
        node = tree.named[name] if name else tree.root
        parts[i + 1], parts[i + 2] = "", ""
        parts[i + 3] = (table(node) if node[0] == "table" else "\n\n".join(blocks(node))) + "\n"
    with open(path, "w") as f:
        f.write("".join(parts))
