"""Certificates: what is written is accepted, what is tampered with is not, and the checker shares no code."""

from __future__ import annotations

import ast
import json
import random
import subprocess
import sys
import tokenize
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
from tippedisk_verify.cli import main
from tippedisk_verify.model.decimals import exact_text
from tippedisk_verify.model.equations import jacobian, shifted
from tippedisk_verify.model.parameters import CALIBRATED, GEOMETRY, PRINTED, SYMBOLS, Parameters
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker import claims
from tippedisk_verify.proofs.kernel.balls import BallOps, ball_constants, series_length, working_precision
from tippedisk_verify.proofs.kernel.flow import Model
from tippedisk_verify.proofs.kernel.reading import decimal
from tippedisk_verify.proofs.search.certificate import cycle_certificate, fold_certificate
from tippedisk_verify.proofs.search.cycle import TURN, prove_cycle
from tippedisk_verify.proofs.search.fold import LibrationFoldProof, prove_fold

ROOM = Path(checker.__file__).parent
FLIGHTS = (("centre",), ("box", "flight"), ("wide box", "flight"))


@lru_cache(maxsize=1)
def written() -> tuple[str, str]:
    """A certificate, and the statement that was proved."""
    proof = prove_cycle(PRINTED, OMEGA, GUESS, digits=2)
    return cycle_certificate(proof), proof.statement


def fresh() -> Any:
    return json.loads(written()[0])


def sealed(content: Any) -> Any:
    content["sha256"] = checker.digest(content)
    return content


def flight(content: Any, names: tuple[str, ...]) -> list[Any]:
    part = content["evidence"]
    for name in names:
        part = part[name]
    return part


_KNOWN: dict[Any, Any] = {}


@pytest.fixture(autouse=True)
def _remembered(monkeypatch) -> None:
    """Steps that were shown once are not shown again: most of a tampered file is as it was."""

    def exactly(x: Any) -> tuple[Any, ...]:
        return (*x.mid().man_exp(), *x.rad().man_exp()) if x.is_finite() else (str(x),)

    def piece(flow: Any, states: Any, length: Any, orders: Any, enclosure: Any) -> Any:
        sets = (states.middle, states.lead, states.axes, states.rest, states.spread, states.deviation)
        balls = [*(x for part in sets for x in part.entries()), flow.w, length, *enclosure]
        key = (ctx.prec, *flow.parameters.values(), *orders, *(part for x in balls for part in exactly(x)))
        if key not in _KNOWN:
            _KNOWN[key] = checker.Piece(flow, states, length, orders, enclosure)
        return _KNOWN[key]

    monkeypatch.setattr(claims, "Piece", piece)


# ---------------------------------------------------------------------------------------------------------- accepted
def test_what_is_written_is_accepted_by_the_command_and_by_the_checker_alone(tmp_path, capsys) -> None:
    path = tmp_path / "cycle.json"
    content, statement = written()
    path.write_text(content)
    assert main(["certify", "check", str(path), "--json"]) == 0
    # The sentence that the checker makes of the claim is the one that was proved.
    assert json.loads(capsys.readouterr().out) == {"accepted": True, "statement": statement}
    # Alone: in a process of its own, with nothing of the prover loaded.
    script = (
        "import sys; from tippedisk_verify.proofs.checker.__main__ import main; status = main(sys.argv[1:]); "
        "mine = {name for name in sys.modules if name.startswith('tippedisk_verify')}; "
        "print(sorted(name for name in mine if name != 'tippedisk_verify' and '.checker' not in name)); "
        "sys.exit(status)"
    )
    run = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")
    sentence, others = run.stdout.splitlines()
    assert sentence == f"proved: {statement}"
    assert others == "[]"


@pytest.mark.slow(minutes=3)
@pytest.mark.parametrize(
    ("parameters", "omega", "digits"),
    [(PRINTED, OMEGA, 12), (PRINTED, OMEGA, 30), (CALIBRATED, OMEGA, 12), (GEOMETRY, Fraction("30.2"), 12)],
)
def test_certificates_of_cycles_are_accepted(taylor, parameters, omega, digits) -> None:
    from tippedisk_verify.atlas.cycles_at_speed import cycle_at

    cycle = cycle_at(parameters, omega, taylor, digits=12)
    proof = prove_cycle(parameters, omega, (cycle.gamma_bar_0.value, cycle.v_0.value), digits=digits)
    assert checker.proved(json.loads(cycle_certificate(proof))) == proof.statement


@pytest.mark.slow(minutes=2)
def test_a_certificate_of_a_rotating_cycle_is_accepted(taylor) -> None:
    from tippedisk_verify.atlas.cycles_at_speed import rotating_cycle

    cycle = rotating_cycle(PRINTED, "31.386592688643567", taylor, stable=False)
    proof = prove_cycle(
        PRINTED, "31.386592688643567", (cycle.beta_bar_top.value, cycle.v_top.value), digits=6, section=TURN
    )
    assert checker.proved(json.loads(cycle_certificate(proof))) == proof.statement


@pytest.mark.slow(minutes=6)
def test_a_certificate_of_a_fold_is_accepted() -> None:
    """It says what the proof says, with half-widths that are a quarter wider."""
    proof = prove_fold(LibrationFoldProof, SUBCRITICAL, SUBCRITICAL_FOLD, digits=5)
    content = json.loads(fold_certificate(proof))
    sentence = checker.proved(content)
    assert "largest value on the curve" in sentence
    assert str(proof.gamma_bar_0) in sentence
    content["claim"]["extremum"] = "smallest"
    number = content["claim"]["numbers"]["gamma_bar_0"]
    number["uncertainty"] = f"-{number['uncertainty']}"  # lower and upper end change places
    content["sha256"] = checker.digest(content)
    with pytest.raises(checker.Unproved, match="no interval"):
        checker.proved(content)


# ---------------------------------------------------------------------------------------------------------- tampered
def nudged(dyadic: str, amount: Fraction) -> str:
    """The dyadic number plus a multiple of 2^-60, or its change by a relative amount."""
    mantissa, exponent = dyadic.split("p")
    value = Fraction(int(mantissa, 16)) * Fraction(2) ** int(exponent) + amount
    scaled = value * 2**400
    assert scaled.denominator == 1
    return f"{int(scaled):x}p-400"


def times(dyadic: str, power: int) -> str:
    mantissa, exponent = dyadic.split("p")
    return f"{mantissa}p{int(exponent) + power}"


def mutations() -> Iterator[tuple[str, Callable[[Any], None]]]:
    """Changes after which the claim is false, a line is not shown, or the file is no certificate."""

    def change(name: str, act: Callable[[Any], Any]) -> tuple[str, Callable[[Any], None]]:
        return name, act

    def put(path: tuple[Any, ...], value: Any) -> Callable[[Any], None]:
        def act(content: Any) -> None:
            part = content
            for name in path[:-1]:
                part = part[name]
            part[path[-1]] = value(part[path[-1]]) if callable(value) else value

        return act

    # The claim: every number elsewhere, and sharper than it is known; every parameter; the speed; what is said of it.
    for name in fresh()["claim"]["numbers"]:
        number = ("claim", "numbers", name)
        beyond = lambda n: {**n, "value": exact_text(Fraction(n["value"]) + 3 * Fraction(n["uncertainty"]))}  # noqa: E731
        sharper = lambda n: {**n, "uncertainty": exact_text(Fraction(n["uncertainty"]) / 10**9)}  # noqa: E731
        yield change(f"{name} elsewhere", put(number, beyond))
        yield change(f"{name} too sharp", put(number, sharper))
        yield change(f"{name} of negative width", put((*number, "uncertainty"), lambda w: f"-{w}"))
        yield change(f"{name} missing", lambda c, name=name: c["claim"]["numbers"].pop(name))
    for name in SYMBOLS:
        # Twice the mass only rescales forces if the inertia does too; each alone moves the orbit.
        yield change(
            f"another {name}", put(("claim", "parameters", name), lambda v: exact_text(Fraction(v) * 1001 / 1000))
        )
        yield change(f"negative {name}", put(("claim", "parameters", name), lambda v: f"-{v}"))
    yield change("another speed", put(("claim", "omega"), "30.386592688645"))
    yield change("unstable", put(("claim", "stable"), False))
    yield change("alone too far", put(("claim", "unique_within", "gamma_bar_0"), "1"))
    yield change("alone too far", put(("claim", "unique_within", "v_0"), "1"))
    yield change("another kind", put(("claim", "kind"), "rotating limit cycle"))
    yield change("unknown kind", put(("claim", "kind"), "torus"))
    # The boxes.
    for index in (0, 1):
        yield change("middle", put(("evidence", "middle", index), lambda m: nudged(m, Fraction(1, 2**40))))
        for name in ("box", "wide box"):
            yield change(f"no {name}", put(("evidence", name, "radii", index), "0p0"))
            yield change(f"{name} of another size", put(("evidence", name, "radii", index), lambda r: times(r, 12)))
            yield change(f"{name} negative", put(("evidence", name, "radii", index), lambda r: f"-{r}"))
            # On the diagonal, where 1 - Y F' becomes -3; the other entries may be as small as the fast contraction.
            at = ("evidence", name, "inverse", index, index)
            yield change(f"{name} inverse", put(at, lambda y: times(y, 2)))
    # The steps.
    for names in FLIGHTS:
        steps = flight(fresh(), names)
        turn = next(index for index, step in enumerate(steps) if "turn" in step)
        for index in (0, turn, len(steps) // 3, len(steps) - 2):
            at = ("evidence", *names, index)
            yield change(f"{at} longer", put((*at, "length"), lambda h: nudged(h, Fraction(1, 2**14))))
            yield change(f"{at} shorter", put((*at, "length"), lambda h: times(h, -1)))
            yield change(f"{at} backwards", put((*at, "length"), lambda h: f"-{h}"))
            yield change(f"{at} of order 1", put((*at, "orders"), [1, 1]))
            for part in ((index + 1) % 3, 3 + (5 * index) % 12):
                yield change(
                    f"{at} narrower in {part}", put((*at, "enclosure", part), lambda e: [e[0], times(e[1], -6)])
                )
            yield change(f"{at} middle", put((*at, "states", "middle", 1), lambda m: nudged(m, Fraction(1, 2**10))))
            yield change(f"{at} lead", put((*at, "states", "lead", 2, 2), lambda x: nudged(x, Fraction(1, 4))))
            yield change(f"{at} axes", put((*at, "states", "axes"), lambda a: [[times(x, -1) for x in r] for r in a]))
            yield change(f"{at} flat axes", put((*at, "states", "axes"), lambda a: [a[0], a[0], a[2]]))
            yield change(f"{at} rest", put((*at, "states", "rest"), lambda q: [times(x, -1) for x in q]))
            yield change(
                f"{at} spread", put((*at, "states", "spread"), lambda q: [[times(x, -1) for x in r] for r in q])
            )
        for key, index in (("turn", turn), ("crossing", len(steps) - 1)):
            at = ("evidence", *names, index, key)
            yield change(f"{key} reversed", put(at, lambda m: m[::-1]))
            yield change(f"{key} too early", put((*at, 1), lambda m: times(m, -1)))
            yield change(f"{key} before the step", put((*at, 0), lambda m: f"-{m}"))
            yield change(f"no {key}", lambda c, at=at, key=key: flight(c, at[1:-1]).pop(key))
        here = lambda c, names=names: flight(c, names)  # noqa: E731
        yield change("last step missing", lambda c, here=here: here(c).pop())
        yield change("a step missing", lambda c, here=here: here(c).pop(7))
        yield change("a step twice", lambda c, here=here: here(c).insert(7, here(c)[7]))
        yield change("steps reordered", lambda c, here=here: here(c).insert(3, here(c).pop(4)))
        yield change("no steps", lambda c, here=here: here(c).clear())
        yield change("no states", lambda c, here=here: here(c)[2].pop("states"))
        yield change("unknown member", lambda c, here=here: here(c)[1].update(note="1p0"))
        yield change("missing member", lambda c, here=here: here(c)[1].pop("orders"))
    # What is no number here.
    at = ("evidence", "centre", 3, "states", "middle", 0)
    for value in (
        1.5,
        1,
        True,
        None,
        [],
        {},
        "",
        "1",
        "0x1p0",
        "1p",
        "1p1e3",
        "nan",
        "inf",
        " 1p0",
        "1p0 ",
        "+1p0",
        "١p0",
    ):
        yield change(f"{value!r} for a point", put(at, value))
    for value in (
        30.3,
        30,
        "nan",
        "inf",
        "1/0",
        "3 0",
        "1_0",
        "0x1e",
        "",
        "١",
        "1e99999",
        "30.386592688644 rad/s and more",
    ):
        yield change(f"{value!r} for a decimal", put(("claim", "omega"), value))
    for value in (0, -1, 1.0, "64", True, 10**9, None):
        yield change(f"{value!r} bits", put(("bits",), value))
    yield change("too few bits", put(("bits",), 24))
    yield change("unknown member", lambda c: c.update(comment="true"))
    yield change("unknown format", put(("format",), "tippedisk certificate 2"))
    yield change("no evidence", lambda c: c.pop("evidence"))
    yield change("huge exponent", put(at, "1p999999"))
    yield change("tiny exponent", put(at, "1p-999999"))


def rejected(name: str, act: Callable[[Any], None]) -> str:
    content = fresh()
    act(content)
    assert content != fresh(), f"{name}: nothing was changed"
    with pytest.raises((checker.Unproved, checker.Refused)) as fault:
        checker.proved(sealed(content))
    line = str(fault.value)
    assert line.isprintable(), name
    # What can be read and was changed by hand is found by a line of the proof, not by the digest.
    assert "sha256" not in line.split("members")[0], name
    return line


@pytest.mark.slow
def test_a_tenth_of_the_tampered_certificates_is_rejected() -> None:
    changes = list(mutations())
    assert len(changes) >= 200
    for name, act in changes[3::10]:
        rejected(name, act)


@pytest.mark.slow(minutes=3)
def test_every_tampered_certificate_is_rejected() -> None:
    lines = {name: rejected(name, act) for name, act in mutations()}
    # Each kind of line is met.
    for kind in (
        "stay in its enclosure", "lie in the states that follow", "no inverse", "not positive", "to pass its level",
        "Krawczyk's image", "within its uncertainty", "the stability", "beta is not shown to fall", "so near",
        "ends where it must not", "not reached", "no disk's", "as text", "whole number", "exactly the members",
    ):  # fmt: skip
        assert any(kind in line for line in lines.values()), kind


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
        with pytest.raises((checker.Unproved, checker.Refused)):
            checker.proved(changed)


def test_a_weaker_claim_is_another_true_claim() -> None:
    """With a new digest it is accepted as what it says: the statement has the wider number."""
    content = fresh()
    content["claim"]["numbers"]["period"]["uncertainty"] = "0.5"
    content["claim"]["stable"] = None
    sentence = checker.proved(sealed(content))
    assert "± 0.5 s" in sentence
    assert "a periodic orbit, of undecided stability" in sentence


@pytest.mark.parametrize(
    ("content", "status"),
    [
        (b"", 2), (b"\xff\xfe\x00", 2), (b"[" * 100_000, 2), (b'{"a":' * 50_000, 2), (b"nan", 2), (b"1", 2), (b"{}", 2),
        (b'{"format": "tippedisk certificate 1", "claim": 1}', 2),
        (b'{"format": "tippedisk certificate 1", "claim": {"kind": ["limit cycle"]}}', 2),
        (b'{"format": 1, "format": "tippedisk certificate 1"}', 2), (b'{"bits": ' + b"9" * 5000 + b"}", 2),
        (b'{"format": "tippedisk certificate 1", "claim": {"kind": "limit cycle"}, "bits": 1e400}', 2),
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
    content["evidence"]["centre"][0]["length"] = "-1p-10"
    path = tmp_path / "file.json"
    path.write_text(json.dumps(sealed(content)))
    assert main(["certify", "check", str(path)]) == 1
    assert capsys.readouterr().err == "tippedisk-verify: not proved: centre, step 1: its length is not positive\n"
    assert main(["certify", "check", str(path), "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {
        "accepted": False,
        "fails": "centre, step 1: its length is not positive",
    }


def test_certificates_are_for_the_linear_law(tmp_path, capsys) -> None:
    target = tmp_path / "c.json"
    arguments = ["certify", "orbit", "--omega", "30.4", "--friction", "smooth", "--certificate", str(target)]
    assert main(arguments) == 2
    assert "certificates are written for the linear friction law only" in capsys.readouterr().err
    assert main(["certify", "orbit", "--omega", "30.4", "--certificate", str(tmp_path / "no" / "c.json")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    # Without a proof there is no certificate.
    nowhere = ["certify", "orbit", "--omega", "30.4", "--guess", "1e-9", "1e-9", "--digits", "2", "--quiet"]
    assert main([*nowhere, "--certificate", str(target)]) == 1
    assert not target.exists()


# ------------------------------------------------------------------------------------------------- the checker itself
def test_the_checker_imports_nothing_of_the_prover() -> None:
    standard = {
        "contextlib",
        "dataclasses",
        "functools",
        "hashlib",
        "io",
        "itertools",
        "json",
        "os",
        "re",
        "sys",
        "tomllib",
        "collections",
        "fractions",
        "typing",
        "__future__",
    }
    for path in ROOM.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert not node.level
                names = [node.module or ""]
            for name in names:
                own = name.startswith("tippedisk_verify.proofs.checker") or name == "flint"
                assert own or name.split(".")[0] in standard, (path.name, name)
    assert "import" not in (Path(tippedisk_verify.__file__).parent / "proofs" / "checker" / "claims.toml").read_text()


@pytest.mark.parametrize(
    ("names", "most"),
    [
        (("__init__", "__main__", "claims", "reading", "steps"), 547),
        (("passage", "connection"), 365),
        (("jets", "curves", "family"), 545),
    ],
)
def test_the_checker_is_short(names: tuple[str, ...], most: int) -> None:
    """Lines of code, without blank ones, comments and docstrings: for cycles and folds, and for the connection."""
    lines = 0
    for path in (ROOM / f"{name}.py" for name in names):
        said: set[int] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if (
                isinstance(node, ast.Expr)
                and isinstance(node.value, ast.Constant)
                and isinstance(node.value.value, str)
            ):
                said |= set(range(node.lineno, (node.end_lineno or 0) + 1))
        with open(path, "rb") as stream:
            blank = (
                tokenize.COMMENT,
                tokenize.NL,
                tokenize.NEWLINE,
                tokenize.INDENT,
                tokenize.DEDENT,
                tokenize.ENCODING,
            )
            code = {
                line
                for token in tokenize.tokenize(stream.readline)
                if token.type not in (*blank, tokenize.ENDMARKER)
                for line in range(token.start[0], token.end[0] + 1)
            }
        lines += len(code - said)
    assert lines <= most


def test_its_equations_are_those_of_the_paper_too() -> None:
    """Two transcriptions, each with its own derivatives, at random points of random disks.

    Their balls, in 200 bits, share a point and are narrow.
    """
    draw = random.Random(11)
    with working_precision(200):
        for _ in range(200):
            disk = {name: str(getattr(PRINTED, name) * Fraction(draw.randint(900, 1100), 1000)) for name in SYMBOLS}
            disk["A"] = str(Fraction(disk["B"]) * Fraction(draw.randint(1000, 1300), 1000))
            constants = ball_constants(Parameters(**{name: Fraction(value) for name, value in disk.items()}))
            state = [arb(draw.uniform(-1.5, 1.5)), arb(draw.uniform(-7, 7)), arb(draw.uniform(-20, 20))]
            speed = arb(draw.uniform(0.1, 60))
            rates, by = checker.Flow(disk, speed).rates(state, True)
            theirs = Model(constants, speed).rates(state)
            rows = jacobian(shifted(BallOps), constants, speed, "linear")(*state)
            step = arb(2) ** -60
            by_speed = [
                (after - before) / (2 * step)  # to the square of the step, 2^-120, times a few thousand
                for after, before in zip(
                    Model(constants, speed + step).rates(state),
                    Model(constants, speed - step).rates(state),
                    strict=True,
                )
            ]
            pairs = [*zip(rates, theirs, strict=True), (by[0], rows[1][0]), *zip(by[2:5], rows[2], strict=True)]
            for mine, other in pairs:
                assert mine.overlaps(other)
                assert mine.rad() < abs(mine).upper() * arb(2) ** -100 + arb(2) ** -150
            for mine, other in ((by[1], by_speed[1]), (by[5], by_speed[2])):
                assert abs(mine - other) < arb(2) ** -100


def test_its_taylor_coefficients_are_those_of_the_recurrences() -> None:
    """State, variational equations and divergence, to order 20."""
    with working_precision(200), series_length(10):
        model = Model(ball_constants(PRINTED), arb("30.4").mid())
        flow = checker.Flow({name: str(getattr(PRINTED, name)) for name in SYMBOLS}, model.omega)
        state = [arb(0.3), arb(1.2), arb(-1.5)]
        theirs = model.with_divergence.coefficients(
            [*state, *(arb(int(row == column)) for column in range(4) for row in range(3)), arb(0)], 20
        )
        mine = flow.taylor([*state, *(arb(int(row == column)) for row in range(3) for column in range(4))], 20)
        order = [0, 1, 2, *(3 + 3 * column + row for row in range(3) for column in range(4)), 15]
        for series, place in zip(mine, order, strict=True):
            assert all(a.overlaps(b) for a, b in zip(series, theirs[place], strict=True))
            assert all(a.rad() < arb(2) ** -120 * (1 + abs(a).upper()) for a in series)


def test_one_bit_is_refused_in_one_line(tmp_path) -> None:
    path = tmp_path / "c.json"
    path.write_text(json.dumps({"format": checker.FORMAT, "claim": {"kind": "limit cycle"}, "bits": 1}))
    with pytest.raises((checker.Refused, checker.Unproved)):
        checker.check(str(path))


def test_a_ratio_may_end_with_zero() -> None:
    assert decimal("911/30") == "911/30"
    for wrong in ("1/0", "1/00", "1/"):
        with pytest.raises(ValueError, match="decimal"):
            decimal(wrong)
