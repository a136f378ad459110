"""The report's page: a single file, with numbers from results.json only, and escaped text."""

from __future__ import annotations

import csv
import json
import re
import shlex
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest

from tests.command_line import TABLE_1_FILE, printed
from tippedisk_verify.figures.exhibit_catalogue import EXHIBITS
from tippedisk_verify.report.audit_pages import _mark_up_symbols

ONLY = "omega_crit,lambda_3,sliding_velocity,chi,attraction,convergent_series,scene_d"
# One too long for its cell is cut: 1.18184621…e-7
NUMBER = re.compile(r"\d+(?:\.\d+)?…?(?:e[+-]?\d+)?")
EMPTY = {"meta", "link", "img", "source", "br", "col", "path", "use"}


class Page(HTMLParser):
    """The elements of a page with their attributes, and the text that a reader sees."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        if tag not in ("span", "a", "b", "code"):
            self.text.append(" ")

    def handle_data(self, data):
        if not {"style", "script"} & set(self.open):
            self.text.append(data)


@pytest.fixture(
    scope="module", params=["part", pytest.param("whole", marks=pytest.mark.slow(minutes=0.7))]
)
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a report on some claims, and one on all."""
    folder = tmp_path_factory.mktemp(request.param)
    only = f"--only {ONLY} --jobs 1" if request.param == "part" else ""
    printed(f"verify --quiet --out {folder} {only}")
    return folder


def test_every_number_on_the_page_is_in_the_results(folder: Path) -> None:
    """Compare the texts digit for digit, after joining numbers that the markup splits."""
    known = set(NUMBER.findall((folder / "results.json").read_text(encoding="utf-8")))
    page = "".join(Page((folder / "report.html").read_text(encoding="utf-8")).text)
    text = (folder / "report.md").read_text(encoding="utf-8").replace("**", "")
    whole = [number.partition("e") for number in known if len(number) > 20]
    for shown in (page, text):
        numbers = NUMBER.findall(shown)
        assert len(numbers) > 100
        missing = {number for number in numbers if number not in known}
        parts = {number: number.partition("…") for number in missing}
        cut = {
            number
            for number, (kept, ellipsis, power) in parts.items()
            if ellipsis
            and any(digits.startswith(kept) and power == e + rest for digits, e, rest in whole)
        }
        assert missing - cut == set()


def test_the_page_stands_alone_and_is_made_for_every_reader(folder: Path) -> None:
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    files = {path.name for path in folder.iterdir()}
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    for tag, attributes in page.elements:
        assert tag != "script"
        assert tag != "img" or attributes.get("alt")
        for target in filter(None, map(attributes.get, ("src", "srcset", "href", "action"))):
            if target.startswith("#"):
                assert target[1:] in ids, target
            else:
                assert target.startswith("data:") or (tag == "a" and target in files), target[:80]
    assert page.open == []
    assert page.elements[0] == ("html", {"lang": "en"})
    assert len(set(ids)) == len(ids)
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch("h[1-6]", tag)]
    assert (levels[0], levels.count(1)) == (1, 1)
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert all(
        wanted in text
        for wanted in ("prefers-color-scheme: dark", "@media print", 'name="viewport"')
    )
    assert not any(loaded in text for loaded in ("url(", "@import"))
    assert len(text) < 4e6


def test_each_claim_has_a_row_that_jumps_to_it(folder: Path) -> None:
    """A claim that does not follow is open and shows what is true; the others are folded."""
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    targets = {attributes.get("href") for tag, attributes in page.elements if tag == "a"}
    assert {f"#claim-{claim['name']}" for claim in results["claims"]} <= targets
    folds = [
        attributes
        for tag, attributes in page.elements
        if tag == "details" and "class" not in attributes
    ]
    opened = ["open" in attributes for attributes in folds]
    assert opened == [
        claim["verdict"] in ("does-not-follow", "undecided") for claim in results["claims"]
    ]
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert (
        sum(claim["instead"] is not None for claim in results["claims"])
        == text.count(" Instead: ")
        > 0
    )


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Omega_crit - 0.5 (claim omega_h)", "Ω<sub>crit</sub> - 0.5 (claim omega_h)"),
        (
            "d(C^2)/dOmega at gamma_bar_0, A_33",
            "d(C<sup>2</sup>)/dΩ at γ̄<sub>0</sub>, A<sub>33</sub>",
        ),
        ("sqrt((r + e)^2 m g/(r Bbar))", "√((r + e)<sup>2</sup> m g/(r B̄))"),
        ("near_omega_h.csv, 1e-3 <b>", "near_omega_h.csv, 1e-3 &lt;b&gt;"),
    ],
)
def test_symbols_are_drawn_and_text_is_escaped(text: str, shown: str) -> None:
    assert _mark_up_symbols(text) == shown


def test_every_figure_has_its_files(folder: Path) -> None:
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    names = {figure["name"] for figure in results["figures"]}
    assert names in (
        {"eigenvalues", "scenes_3d", "scenes_2d"},
        {exhibit.name for exhibit in EXHIBITS},
    )
    for figure in results["figures"]:
        kinds = {name.rpartition(".")[2] for name in figure["files"]}
        assert kinds == {"png", "svg", "csv"}, figure["name"]
        assert figure["reading"].endswith(".")
        for name in figure["files"]:
            assert (folder / name).stat().st_size > 50
            if name.endswith(".csv"):
                columns_of_doubles_have_a_unit(folder / name)
    page = "".join(Page((folder / "report.html").read_text(encoding="utf-8")).text)
    for text in (page, (folder / "report.md").read_text(encoding="utf-8")):
        assert all(claim["command"] in text for claim in results["claims"])


def columns_of_doubles_have_a_unit(path: Path) -> None:
    with open(path, encoding="utf-8", newline="") as lines:
        for name, *cells in zip(*csv.reader(lines), strict=True):
            filled = [cell for cell in cells if cell]
            if all(
                re.fullmatch(r"-?\d+(\.\d+)?(e[+-]?\d+)?", cell) and re.search("[.e]", cell)
                for cell in filled
            ):
                assert re.search(r" \[[^\]]+\]$", name), f"{path.name}: {name}"
                assert all(cell == repr(float(cell)) for cell in filled), f"{path.name}: {name}"


@pytest.mark.parametrize("disk", [pytest.param("table1", marks=pytest.mark.slow), "own.toml"])
def test_a_verdict_has_the_same_words_on_the_terminal_and_in_the_report(
    disk: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The claims include all verdicts: different between sets, proved, and each kind of fault."""
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text(TABLE_1_FILE, encoding="utf-8")
    only = "omega_crit,lambda_3,chi,kappa_1,kappa_2,linearization,inverted_unstable_below,convergent_series"
    lines = printed(f"verify --only {only} --out out --parameters {disk} --jobs 1")
    terminal = dict(re.findall(r"^(\w+)  +(\S.*?)(?:  .*|)$", lines, re.MULTILINE))
    page = Page(Path("out/report.html").read_text(encoding="utf-8"))
    text = Path("out/report.md").read_text(encoding="utf-8")
    cells = " ".join("".join(page.text).split())
    for name in only.split(","):
        words = terminal[name]
        assert f"### {name}: {words}\n" in text
        assert re.search(rf"\| {name} \| .* \| {re.escape(words)} \|\n", text)
        # Its row, and its claim
        assert len(re.findall(rf"\b{name} .{{0,400}}?[✓◐✗?] {re.escape(words)} ", cells)) >= 2


def test_results_of_earlier_runs_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TIPPEDISK_VERIFY_CACHE", str(tmp_path))
    line = "2 of 2 results are from earlier runs: --fresh computes them again\n"
    says = [
        line in printed(f"verify --only omega_crit,lambda_3 {more}")
        for more in ("", "", "--fresh", "--json")
    ]
    assert says == [False, True, False, False]


def test_names_from_outside_are_text(tmp_path: Path) -> None:
    path = tmp_path / "<script>alert(1)</script>&`x`[a](b)|.toml".replace("/", "∕")
    path.write_text(TABLE_1_FILE, encoding="utf-8")
    out = tmp_path / "out"
    words = ["verify", "--quiet", "--only", "omega_crit", "--out", out, "--parameters", path]
    printed(shlex.join(map(str, words)))
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    assert "script" not in {tag for tag, _ in page.elements}
    assert path.name in "".join(page.text)
    text = (out / "report.md").read_text(encoding="utf-8")
    spans = re.compile(r"`[^`\n]*`")  # of code, in which nothing is markup
    assert "<script>" not in spans.sub("", text).replace("\\<script>", "")


def test_an_odd_but_possible_disk_gets_its_report(tmp_path: Path) -> None:
    """With little gravity Omega_crit - 0.5 is negative: there is no scene d, and the figure has the
    reason.
    """
    path = tmp_path / "low.toml"
    path.write_text(TABLE_1_FILE.replace("9.81", "1e-9"), encoding="utf-8")
    out = tmp_path / "out"
    only = "inverted_unstable_below scene_d"
    printed(f"verify --quiet --out {out} --parameters {path} --only {only}")
    below, scene = json.loads((out / "results.json").read_text(encoding="utf-8"))["claims"]
    assert (below["verdict"], scene["verdict"]) == ("holds", "holds-for")
    assert "not positive" in scene["note"]
    assert "Not drawn: scene d: its speed" in (out / "report.html").read_text(encoding="utf-8")
    assert "Not drawn: scene d: its speed" in (out / "report.md").read_text(encoding="utf-8")
    assert not (out / "scenes_3d.png").exists()
