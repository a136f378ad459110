"""Certificates: what a proof logs is accepted by the kernel alone, and what is tampered with is not."""

from __future__ import annotations

import ast
import json
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
from flint import arb, ctx

import tippedisk_verify
from tests.proofs.test_cycle import GUESS, OMEGA
from tests.proofs.test_fold import SUBCRITICAL, SUBCRITICAL_FOLD
from tests.proofs.test_sliding import GUESS as SMOOTH_GUESS
from tests.proofs.test_sliding import SMOOTH
from tippedisk_verify.cli import main
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.parameters import CALIBRATED, GEOMETRY, PRINTED, SYMBOLS
from tippedisk_verify.proofs.kernel import claims, flow, krawczyk, sliding
from tippedisk_verify.proofs.kernel import field as equations
from tippedisk_verify.proofs.kernel.balls import midpoint_and_radius, working_precision
from tippedisk_verify.proofs.kernel.claims import FORMAT, proved
from tippedisk_verify.proofs.kernel.reading import decimal, dyadic, dyadic_text, held
from tippedisk_verify.proofs.kernel.series import System
from tippedisk_verify.proofs.search.cycle import TURN, prove_cycle
from tippedisk_verify.proofs.search.fold import prove_fold

KERNEL = Path(tippedisk_verify.__file__).parent / "proofs" / "kernel"
PROOFS: dict[str, Callable[[], Any]] = {
    "cycle": lambda: prove_cycle(PRINTED, OMEGA, GUESS, digits=2),
    "smooth": lambda: prove_cycle(SMOOTH, OMEGA, SMOOTH_GUESS, digits=2),
    "rotation": lambda: prove_cycle(PRINTED, "30.0388", ("0.46984", "0.60389"), digits=2, section=TURN),
    "fold": lambda: prove_fold(SUBCRITICAL, SUBCRITICAL_FOLD, digits=5),
}


@lru_cache(maxsize=4)
def written(kind: str = "cycle") -> tuple[str, str]:
    """A certificate, and the statement that was proved."""
    proof = PROOFS[kind]()
    return proof.certificate(), proof.statement


def fresh(kind: str = "cycle") -> Any:
    return json.loads(written(kind)[0])


def sealed(content: Any) -> Any:
    content["sha256"] = claims.digest(content)
    return content


Names = tuple[str, ...]


def at(content: Any, names: tuple[Any, ...]) -> Any:
    for name in names:
        content = content[name]
    return content


def flights(content: Any) -> list[Names]:
    """Where the logs are."""
    evidence, found = content["evidence"], []
    for prefix in [(name,) for name in evidence if "centre" in evidence[name]] or [()]:
        point = at(evidence, prefix)
        boxes = [name for name in ("box", "wide box") if name in point]
        found += [("evidence", *prefix, "centre"), *(("evidence", *prefix, name, "flight") for name in boxes)]
    return found


_KNOWN: dict[Any, Any] = {}


@pytest.fixture
def remembered(monkeypatch) -> None:
    """Series that were computed once are not computed again: most of a tampered file is as it was."""

    def exactly(x: Any) -> tuple[Any, ...]:
        return (*x.mid().man_exp(), *x.rad().man_exp()) if x.is_finite() else (str(x),)

    def model(friction: str, constants: Any, omega: Any) -> Any:
        key = ("model", ctx.prec, friction, *(part for x in (*constants, omega) for part in exactly(x)))
        if key not in _KNOWN:
            _KNOWN[key] = LAW_MODEL(friction, constants, omega)
        return _KNOWN[key]

    def coefficients(self: System, start: Any, order: int) -> Any:
        key = (id(self), ctx.prec, order, *(part for x in start for part in exactly(x)))
        if key not in _KNOWN:
            _KNOWN[key] = COEFFICIENTS(self, start, order)
        return [list(column) for column in _KNOWN[key]]

    monkeypatch.setattr(krawczyk, "law_model", model)
    monkeypatch.setattr(System, "coefficients", coefficients)


LAW_MODEL, COEFFICIENTS = sliding.law_model, System.coefficients


# ---------------------------------------------------------------------------------------------------------- accepted
def test_what_is_written_is_accepted_by_the_command_and_by_the_kernel_alone(tmp_path, capsys) -> None:
    path = tmp_path / "cycle.json"
    content, statement = written()
    path.write_text(content)
    assert main(["certify", "check", str(path), "--json"]) == 0
    # The sentence that the kernel makes of the claim is the one that was proved.
    assert json.loads(capsys.readouterr().out) == {"accepted": True, "statement": statement}
    # Alone: in a process of its own, with nothing of the search loaded.
    script = (
        "import sys; from tippedisk_verify.proofs.kernel.__main__ import main; status = main(sys.argv[1:]); "
        "mine = {name for name in sys.modules if name.startswith('tippedisk_verify.')}; "
        "alone = ('tippedisk_verify.proofs.kernel', 'tippedisk_verify.errors'); "
        "print(sorted(name for name in mine if not name.startswith(alone) and name != 'tippedisk_verify.proofs')); "
        "sys.exit(status)"
    )
    run = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")
    sentence, others = run.stdout.splitlines()
    assert sentence == f"proved: {statement}"
    assert others == "[]"


@pytest.mark.slow(minutes=2)
@pytest.mark.parametrize("kind", [kind for kind in PROOFS if kind != "cycle"])
def test_certificates_of_every_kind_are_accepted(kind: str) -> None:
    content, statement = written(kind)
    assert proved(json.loads(content)) == statement


@pytest.mark.slow(minutes=3)
@pytest.mark.parametrize(
    ("parameters", "omega", "digits"),
    [(PRINTED, OMEGA, 30), (CALIBRATED, OMEGA, 12), (GEOMETRY, Fraction("30.2"), 12)],
)
def test_certificates_of_cycles_are_accepted(taylor, parameters, omega, digits) -> None:
    from tippedisk_verify.atlas.cycles_at_speed import cycle_at

    cycle = cycle_at(parameters, omega, taylor, digits=12)
    proof = prove_cycle(parameters, omega, (cycle.gamma_bar_0.value, cycle.v_0.value), digits=digits)
    assert proved(json.loads(proof.certificate())) == proof.statement


def test_points_are_written_and_read_exactly() -> None:
    for point in (0.1, -3.25, 0, 2.0**-300):
        assert dyadic(dyadic_text(point)) == point


# ---------------------------------------------------------------------------------------------------------- tampered
def times(number: str, power: int) -> str:
    mantissa, exponent = number.split("p")
    return f"{mantissa}p{int(exponent) + power}"


def further(number: str) -> str:
    with working_precision(2000):
        return dyadic_text(dyadic(number) + dyadic("1p-16"))


def put(path: tuple[Any, ...], value: Any) -> Callable[[Any], None]:
    def act(content: Any) -> None:
        part = at(content, path[:-1])
        part[path[-1]] = value(part[path[-1]]) if callable(value) else value

    return act


Change = tuple[str, Callable[[Any], None]]


def false_claims(content: Any) -> Iterator[Change]:
    """Every number elsewhere, and sharper than it is known; every parameter; the law; the speed; the rest."""
    claim = content["claim"]
    first = next(name for name in claim["numbers"] if name in ("gamma_bar_0", "beta_bar_top"))
    fold = "extremum" in claim
    for name in claim["numbers"]:
        if fold and name == first:  # of a fold the arc, which is what the claim is about
            continue
        number = ("claim", "numbers", name)
        beyond = lambda n: {**n, "value": exact_text(Fraction(n["value"]) + 3 * Fraction(n["uncertainty"]))}  # noqa: E731
        sharper = lambda n: {**n, "uncertainty": exact_text(Fraction(n["uncertainty"]) / 10**9)}  # noqa: E731
        yield f"{name} elsewhere", put(number, beyond)
        yield f"{name} too sharp", put(number, sharper)
        yield f"{name} of negative width", put((*number, "uncertainty"), lambda w: f"-{w}")
        yield f"{name} missing", lambda c, name=name: c["claim"]["numbers"].pop(name)
    for name in SYMBOLS:
        # Twice the mass only rescales forces if the inertia does too; each alone moves the orbit.
        another = put(("claim", "parameters", name), lambda v: exact_text(Fraction(v) * 1001 / 1000))
        yield f"another {name}", another
        yield f"negative {name}", put(("claim", "parameters", name), lambda v: f"-{v}")
    yield "another law", put(("claim", "friction"), lambda law: "linear" if law == "smooth" else "smooth")
    yield "unknown law", put(("claim", "friction"), "dry")
    other = {"limit cycle": "rotating limit cycle", "rotating limit cycle": "limit cycle"}
    yield "another kind", put(("claim", "kind"), other.get(claim["kind"], "fold of rotating limit cycles"))
    yield "unknown kind", put(("claim", "kind"), "torus")
    if fold:
        yield "another extremum", put(("claim", "extremum"), lambda e: "smallest" if e == "largest" else "largest")
        yield (
            "an arc beside",
            put(("claim", "numbers", first, "value"), lambda x: exact_text(Fraction(x) + Fraction(1, 10**4))),
        )
        yield "an empty arc", put(("claim", "numbers", first, "uncertainty"), "0")
        yield "a longer arc", put(("claim", "numbers", first, "uncertainty"), lambda x: exact_text(10 * Fraction(x)))
        return
    yield "another speed", put(("claim", "omega"), lambda x: exact_text(Fraction(x) + Fraction(1, 10**6)))
    yield "another stability", put(("claim", "stable"), lambda stable: not stable)
    for name in claim["unique_within"]:
        yield f"alone too far in {name}", put(("claim", "unique_within", name), "1")
    if "reversals" in claim:
        yield "other reversals", put(("claim", "reversals"), lambda n: n + 2)
        yield "no reversals", lambda c: c["claim"].pop("reversals")


def other_boxes(content: Any) -> Iterator[Change]:
    for names in flights(content):
        if names[-1] == "centre":
            for index in (0, 1):
                middle = (*names[:-1], "middle", index)
                yield f"{middle} elsewhere", put(middle, further)
            continue
        for index in (0, 1):
            box = names[:-1]
            yield f"{box} without {index}", put((*box, "radii", index), "0p0")
            if "end" not in names[1]:  # there a larger box may do as well
                yield f"{box} of another size", put((*box, "radii", index), lambda r: times(r, 14))
            yield f"{box} negative", put((*box, "radii", index), lambda r: f"-{r}")
        # Where 1 - Y F' becomes -3; an entry by itself may be as small as the fast contraction.
        yield f"{box} inverse", put((*box, "inverse"), lambda y: [[times(x, 2) for x in row] for row in y])


def other_steps(content: Any) -> Iterator[Change]:
    for names in flights(content):
        steps = at(content, names)
        for index in (0, len(steps) // 3, len(steps) // 2, len(steps) - 1):
            entry = (*names, index)
            first = (*entry, "steps", 0)
            yield f"{entry} much longer", put((*first, 0), lambda h: times(h, 3))
            yield f"{entry} backwards", put((*first, 0), lambda h: f"-{h}")
            yield f"{entry} of no length", put((*first, 0), "0p0")
            yield f"{entry} of order 1", put(first, lambda s: [s[0], 1, 1])
            yield f"{entry} flat axes", put((*entry, "axes"), lambda a: [a[0], a[0], a[2]])
            yield f"{entry} untested", put((*entry, "steps"), [])
        for index, step in enumerate(steps):
            if len(step["steps"]) > 1:
                entry = (*names, index)
                yield f"{entry} nothing behind the change", put((*entry, "steps"), lambda s: s[:1])
                yield f"{entry} too short behind it", put((*entry, "steps", 1, 0), lambda h: times(h, -6))
        here = lambda c, names=names: at(c, names)  # noqa: E731
        yield "last step missing", lambda c, here=here: here(c).pop()
        # A single short step may be made up for by the last one, which need not end at the section.
        yield "a third of the steps missing", lambda c, here=here: here(c).__delitem__(slice(7, None, 3))
        yield "another step at the end", lambda c, here=here: here(c).append(here(c)[3])
        yield "no steps", lambda c, here=here: here(c).clear()
        yield "unknown member", lambda c, here=here: here(c)[1].update(note="1p0")
        yield "missing member", lambda c, here=here: here(c)[1].pop("axes")


def unreadable(content: Any) -> Iterator[Change]:
    """What is no number here, and other shapes."""
    names = flights(content)[0]
    point = (*names, 3, "axes", 0, 0)
    for value in (1.5, 1, True, None, [], {}, "", "1", "0x1p0", "1p", "1p1e3", "nan", "inf", " 1p0", "1p0 ", "+1p0",
                  "\u0661p0"):  # fmt: skip
        yield f"{value!r} for a point", put(point, value)
    for value in (30.3, 30, "nan", "inf", "1/0", "3 0", "1_0", "0x1e", "", "\u0661", "1e99999", "30.38 rad/s and more"):
        yield f"{value!r} for a decimal", put(("claim", "parameters", "g"), value)
    for value in (0, -1, 1.0, "64", True, 10**9, None, 23):
        yield f"{value!r} bits", put(("bits",), value)
        if "wide box" in content["evidence"]:
            yield f"{value!r} bits of the wide box", put(("evidence", "wide box", "bits"), value)
    yield "too few bits", put(("bits",), 24)
    yield "unknown member", lambda c: c.update(comment="true")
    yield "unknown format", put(("format",), "tippedisk certificate 1")
    yield "no evidence", lambda c: c.pop("evidence")
    yield "a length of 54 bits", put((*names, 3, "steps", 0, 0), "20000000000001p-63")
    yield "a huge exponent", put((*names, 3, "steps", 0, 0), "1p999999")  # axes may be as long as they like


def rejected(kind: str, name: str, act: Callable[[Any], None]) -> str:
    content = fresh(kind)
    act(content)
    assert content != fresh(kind), f"{name}: nothing was changed"
    try:
        proved(sealed(content))
    except (claims.Unproved, claims.Refused) as fault:
        line = str(fault)
    else:
        pytest.fail(f"accepted: {name}")
    assert line.isprintable(), name
    # What can be read and was changed by hand is found by a line of the proof, not by the digest.
    assert "sha256" not in line.split("members")[0], name
    return line


def mutations(kind: str) -> list[Change]:
    content = fresh(kind)
    return [*false_claims(content), *other_boxes(content), *other_steps(content), *unreadable(content)]


def test_some_tampered_certificates_are_rejected(remembered) -> None:
    changes = mutations("cycle")
    assert len(changes) >= 150
    for name, act in changes[3::12]:
        rejected("cycle", name, act)


@pytest.mark.slow(minutes=4)
@pytest.mark.parametrize("kind", PROOFS)
def test_every_tampered_certificate_is_rejected(kind: str, remembered) -> None:
    lines = {name: rejected(kind, name, act) for name, act in mutations(kind)}
    _KNOWN.clear()
    for said in ("stay in its enclosure", "its steps end on the way", "that nothing asks for",
                 "Krawczyk's image", "within its uncertainty", "no disk's", "as text", "whole number",
                 "exactly the members"):  # fmt: skip
        assert any(said in line for line in lines.values()), said


# Each term of the equations, a thousandth larger.
TERMS = (
    ("rho = r +", "rho = r * LARGER +"), ("+ e * c", "+ e * c * LARGER"), ("mass = b +", "mass = b * LARGER +"),
    ("unlike * (t * t)", "unlike * LARGER * (t * t)"), ("lever * lever", "lever * lever * LARGER"),
    ("mixed = twice_unlike", "mixed = LARGER * twice_unlike"), ("+ e * rho -", "+ e * rho * LARGER -"),
    ("- three_e", "- LARGER * three_e"), ("sweep * sweep", "LARGER * sweep * sweep"),
    ("square * (", "square * LARGER * ("),
    ("r * lifted", "r * LARGER * lifted"), ("omega * (t", "omega * LARGER * (t"), ("- g * rho", "- g * LARGER * rho"),
    ("slip = sweep +", "slip = LARGER * sweep +"), ("drift * (C * t)", "drift * LARGER * (C * t)"),
    ("return v, omega * s", "return v, LARGER * omega * s"), ("return v,", "return LARGER * v,"),
    ("constants.k * grip", "constants.k * LARGER * grip"), ("- lifted) *", "- LARGER * lifted) *"),
    ("traction * grip", "traction * LARGER * grip"), ("law * sliding", "LARGER * law * sliding"),
    ("+ constants.epsilon", "+ LARGER * constants.epsilon"),
)  # fmt: skip


@pytest.mark.slow(minutes=2)
@pytest.mark.parametrize(("old", "new"), TERMS, ids=[new for _, new in TERMS])
def test_a_term_that_is_a_thousandth_larger_is_noticed_by_a_certificate(old: str, new: str, monkeypatch) -> None:
    """In the equations of a kernel that checks certificates written with the right ones."""
    contents = [fresh("cycle"), fresh("smooth")]
    source = Path(equations.__file__).read_text(encoding="utf-8")
    begin, end = source.index("def field("), source.index("def one_sided(")
    body = source[begin:end]
    assert body.count(old) == 1, old
    names = dict(vars(equations)) | {"LARGER": _Larger()}
    exec(body.replace(old, new), names)
    for module in (equations, flow):
        monkeypatch.setattr(module, "field", names["field"])
    lines = []
    for content in contents:
        try:
            proved(content)
        except claims.Unproved as fault:
            lines.append(str(fault))
    assert lines


class _Larger:
    """1.001 times whatever it meets."""

    def __mul__(self, other: Any) -> Any:
        return other * arb(1.001)

    __rmul__ = __mul__


def test_a_half_width_of_a_few_last_bits_is_held() -> None:
    """As that of the sharpest of a cycle's numbers to many digits; and half of it is not."""
    with working_precision(64):
        for n in range(3, 200, 2):
            x = arb(1) / n
            middle, half = midpoint_and_radius(x)
            held({"value": str(middle), "uncertainty": str(half)}, x, "a number")
            with pytest.raises(claims.Unproved):
                held({"value": str(middle), "uncertainty": str(half / 2)}, x, "a number")


def test_any_changed_character_is_noticed_by_the_digest() -> None:
    draw = random.Random(5)
    for _ in range(40):
        content, _ = written()
        place = draw.randrange(len(content) - 1)
        other = draw.choice([character for character in "0123456789abcdef" if character != content[place]])
        try:
            changed = json.loads(content[:place] + other + content[place + 1 :])
        except ValueError:
            continue
        with pytest.raises((claims.Unproved, claims.Refused)):
            claims.proved(changed)


def test_a_weaker_claim_is_another_true_claim() -> None:
    """With a new digest it is accepted as what it says: the statement has the wider number."""
    content = fresh()
    content["claim"]["numbers"]["period"]["uncertainty"] = "0.5"
    content["claim"]["stable"] = None
    sentence = proved(sealed(content))
    assert "± 0.5 s" in sentence
    assert "a periodic orbit, of undecided stability" in sentence


@pytest.mark.parametrize(
    ("content", "status"),
    [
        (b"", 2), (b"\xff\xfe\x00", 2), (b"[" * 100_000, 2), (b'{"a":' * 50_000, 2), (b"nan", 2), (b"1", 2), (b"{}", 2),
        (b'{"format": "tippedisk certificate 2", "claim": 1}', 2),
        (b'{"format": "tippedisk certificate 2", "claim": {"kind": ["limit cycle"]}}', 2),
        (b'{"format": 1, "format": "tippedisk certificate 2"}', 2), (b'{"bits": ' + b"9" * 5000 + b"}", 2),
        (b'{"format": "tippedisk certificate 2", "claim": {"kind": "limit cycle"}, "bits": 1e400}', 2),
    ],
)  # fmt: skip
def test_what_is_no_certificate_ends_in_one_line(tmp_path, capsys, content, status) -> None:
    path = tmp_path / "file.json"
    path.write_bytes(content)
    assert main(["certify", "check", str(path)]) == status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1


def test_what_is_no_file_ends_in_one_line(tmp_path, capsys) -> None:
    with open(tmp_path / "large.json", "wb") as stream:
        stream.truncate(2**32)  # takes no room on the disk
    for name in ("large.json", "", "missing.json", "\0"):
        assert main(["certify", "check", str(tmp_path / name)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_claim_that_is_not_shown_has_status_one_and_its_line(tmp_path, capsys) -> None:
    content = fresh()
    content["evidence"]["centre"][0]["steps"][0][0] = "-1p-10"
    path = tmp_path / "file.json"
    path.write_text(json.dumps(sealed(content)))
    line = "box, centre, step 1: the states and derivatives over it are not shown to stay in its enclosure"
    assert main(["certify", "check", str(path)]) == 1
    assert capsys.readouterr().err == f"tippedisk-verify: not proved: {line}\n"
    assert main(["certify", "check", str(path), "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"accepted": False, "fails": line}


def test_an_old_certificate_is_refused_in_one_clear_line() -> None:
    with pytest.raises(claims.Refused, match=f"its format is not '{FORMAT}': write it again"):
        proved({"format": "tippedisk certificate 1", "claim": {"kind": "limit cycle"}})


def test_where_no_certificate_is_written(tmp_path, capsys) -> None:
    target = tmp_path / "c.json"
    guess = ["certify", "orbit", "--omega", "30.4", "--guess", "1.57", "-1.6", "--digits", "2"]
    assert main([*guess, "--certificate", str(tmp_path / "no" / "c.json")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    # Without a proof there is no certificate.
    nowhere = ["certify", "orbit", "--omega", "30.4", "--guess", "1e-9", "1e-9", "--digits", "2", "--quiet"]
    assert main([*nowhere, "--certificate", str(target)]) == 1
    assert not target.exists()


# ------------------------------------------------------------------------------------------------- the kernel itself
def test_the_kernel_stands_alone() -> None:
    """It imports numpy, python-flint and the standard library."""
    for path in KERNEL.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert not node.level
                names = [node.module or ""]
            for name in names:
                first = name.split(".")[0]
                own = name.startswith("tippedisk_verify.proofs.kernel") or first in ("flint", "numpy")
                assert own or first in sys.stdlib_module_names, (path.name, name)


def test_one_bit_is_refused_in_one_line(tmp_path) -> None:
    path = tmp_path / "c.json"
    path.write_text(json.dumps({"format": FORMAT, "claim": {"kind": "limit cycle"}, "bits": 1}))
    with pytest.raises(claims.Refused, match="bits"):
        claims.check(str(path))


def test_a_ratio_may_end_with_zero() -> None:
    assert decimal("911/30") == "911/30"
    for wrong in ("1/0", "1/00", "1/"):
        with pytest.raises(ValueError, match="decimal"):
            decimal(wrong)
