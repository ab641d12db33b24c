"""A lesson as slides for LaTeX, with beamer: one frame for each heading."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING
from unicodedata import lookup, normalize

from markdown_it import MarkdownIt

import kincompile as kc
from docs.builders import lessons
from kincompile.derivations.slides import slides_of
from kincompile.report.tex import escape
from kincompile.report.to_latex import as_tex

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from markdown_it.token import Token

GREEK = (
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "mu",
    "nu", "xi", "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
)  # fmt: skip
LETTERS = {lookup(f"GREEK SMALL LETTER {name}"): f"\\{name}" for name in GREEK} | {
    "Φ": r"\Phi", "Δ": r"\Delta", "λ": r"\lambda", "²": "{}^2", "³": "{}^3", "ᵀ": "{}^T",
    "·": r"\cdot", "°": r"{}^\circ", "√": r"\surd", "≥": r"\ge", "≤": r"\le", "≠": r"\ne",
}  # fmt: skip
DOTTED = {"\u0307": r"\dot", "\u0308": r"\ddot"}
INDEX = re.compile(r"(?<![A-Za-z])(\w|\)|\})\\_([A-Za-z]+)\b")
"""A letter or a bracket with an index, in prose that is LaTeX."""

SMALL = "\\begingroup\\scriptsize\n\\begin{verbatim}\n"

PREAMBLE = r"""\documentclass[10pt,aspectratio=169]{beamer}
\usepackage[utf8]{inputenc}
\usepackage{amsmath}
\let\phi\varphi
\newsavebox{\fitbox}
% A formula that is shrunk where it is wider than the slide.
\newcommand{\fit}[1]{\sbox{\fitbox}{$\displaystyle #1$}%
  \ifdim\wd\fitbox>\linewidth\resizebox{\linewidth}{!}{\usebox{\fitbox}}%
  \else\usebox{\fitbox}\fi}
\setlength{\unitlength}{1bp}
\setbeamertemplate{navigation symbols}{}
\setbeamertemplate{footline}[frame number]
\setcounter{MaxMatrixCols}{30}
"""


def beamer(lesson: lessons.Lesson) -> str:
    """Return a lesson as the text of a .tex file."""
    text = lessons.MATH.sub(r"~~~math\n\1~~~", lesson.text)
    text = lessons.LIVE.sub(r"The mechanism in motion: open `live.html`.", text)
    first, *others = re.split(r"^## ", re.sub(r"<!--.*?-->\n", "", text), flags=re.MULTILINE)
    declared = "".join(
        rf"\DeclareUnicodeCharacter{{{ord(letter):04X}}}{{\ensuremath{{{command}}}}}" + "\n"
        for letter, command in LETTERS.items()
    )
    printer = _Printer(_picture(lesson))
    frames = "".join(printer.frame(part) for part in others)
    head = rf"\title{{{prose(lesson.title)}}}" + "\n\\date{}\n\\begin{document}\n"
    opening = "\\begin{frame}\n\\titlepage\n" + printer.body(first.partition("\n")[2])
    return PREAMBLE + declared + head + opening + "\\end{frame}\n" + frames + "\\end{document}\n"


def prose(text: str) -> str:
    """Return plain text as LaTeX; a letter with dots is a formula."""

    def dotted(match: re.Match[str]) -> str:
        letter = LETTERS.get(match[1], match[1])
        return rf"\ensuremath{{{DOTTED[match[2]]}{{{letter}}}}}"

    return re.sub(f"(.)([{''.join(DOTTED)}])", dotted, escape(normalize("NFD", text)))


def _picture(lesson: lessons.Lesson) -> str:
    """Return the sketch of a lesson as a LaTeX picture."""
    whole = slides_of(kc.derivation(lesson.model))
    text = as_tex(replace(whole, sections=whole.sections[:1]))
    (found,) = re.findall(r"\\begin\{picture\}.*\\end\{picture\}", text, re.DOTALL)
    return rf"\begin{{center}}\resizebox{{!}}{{0.55\textheight}}{{{found}}}\end{{center}}"


class _Printer:
    """Prints Markdown as LaTeX: paragraphs, lists, tables, programs, formulas."""

    def __init__(self, picture: str) -> None:
        self._picture = picture
        self._reader = MarkdownIt("commonmark").enable("table")

    def frame(self, part: str) -> str:
        """Return a part, a heading and what follows, as a frame."""
        title, _, text = part.partition("\n")
        start = rf"\begin{{frame}}[fragile,allowframebreaks]{{{prose(title)}}}"
        return f"{start}\n{self.body(text)}\\end{{frame}}\n"

    def body(self, text: str) -> str:
        """Return a text as LaTeX."""
        return "\n".join(self._lines(self._reader.parse(text))) + "\n"

    def _lines(self, tokens: Sequence[Token]) -> Iterator[str]:
        lists = {"bullet_list": "itemize", "ordered_list": "enumerate"}
        ends = {"th_close": " &", "td_close": " &", "tr_close": r"\relax\\"}
        for position, token in enumerate(tokens):
            kind, _, end = token.type.rpartition("_")
            if token.type == "inline":
                yield self._inline(token.children or ())
            elif token.type == "fence" and token.info == "math":
                yield rf"\[ \fit{{{token.content.strip()}}} \]"
            elif token.type in ("fence", "code_block"):
                yield f"{SMALL}{token.content}\\end{{verbatim}}\n\\endgroup"
            elif kind in lists:
                yield rf"\{'begin' if end == 'open' else 'end'}{{{lists[kind]}}}"
            elif token.type == "list_item_open":
                yield r"\item"
            elif kind == "table":
                yield _tabular(tokens[position:]) if end == "open" else r"\end{tabular}"
            elif token.type == "paragraph_close":
                yield ""
            else:
                yield ends.get(token.type, "")

    def _inline(self, children: Sequence[Token]) -> str:
        shown = {
            "strong_open": r"\textbf{", "em_open": r"\emph{", "strong_close": "}", "em_close": "}",
            "softbreak": " ", "image": self._picture,
        }  # fmt: skip
        found = ""
        for token in children:
            if token.type == "text":
                found += INDEX.sub(r"\1\\textsubscript{\2}", prose(token.content))
            elif token.type == "code_inline":
                found += rf"\texttt{{{prose(token.content)}}}"
            else:
                found += shown.get(token.type, "")
        return found


def _tabular(tokens: Sequence[Token]) -> str:
    """Return the beginning of a table, with columns of equal widths."""
    kinds = [token.type for token in tokens]
    columns = kinds[: kinds.index("tr_close")].count("th_open")
    width = rf"p{{{0.85 / columns:.2f}\linewidth}}"
    return rf"\small\begin{{tabular}}{{@{{}}*{{{columns}}}{{{width}}}l@{{}}}}"
