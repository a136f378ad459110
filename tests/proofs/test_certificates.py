"""Certificates: what a proof logs is accepted by the kernel alone, and what is tampered with
is not.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache
from typing import Any

import pytest
from flint import arb, ctx

from tests.command_line import answer, assert_refused, printed, ran
from tests.proofs.cases import replace_entry, sealed
from tests.proofs.test_cycle import OMEGA, proved_cycle
from tests.proofs.test_fold import SUBCRITICAL, SUBCRITICAL_FOLD
from tests.proofs.test_sliding import GUESS as SMOOTH_GUESS
from tests.proofs.test_sliding import SMOOTH
from tippedisk_verify.model.parameters import PRINTED, SYMBOLS
from tippedisk_verify.numbers.decimals import exact_text
from tippedisk_verify.proofs.kernel import certificates, krawczyk, sliding
from tippedisk_verify.proofs.kernel.balls import midpoint_and_radius, working_precision
from tippedisk_verify.proofs.kernel.certificate_format import (
    dyadic_text,
    read_dyadic,
    require_claimed_enclosure,
)
from tippedisk_verify.proofs.kernel.certificates import verify_content
from tippedisk_verify.proofs.kernel.taylor_recurrences import System
from tippedisk_verify.proofs.search.cycle_proof import ROTATING_SECTION, prove_cycle
from tippedisk_verify.proofs.search.fold_proof import prove_fold

PROOFS: dict[str, Callable[[], Any]] = {
    "cycle": proved_cycle,
    "smooth": lambda: prove_cycle(SMOOTH, OMEGA, SMOOTH_GUESS, digits=2),
    "rotation": lambda: prove_cycle(
        PRINTED, "30.0388", ("0.46984", "0.60389"), digits=2, section=ROTATING_SECTION
    ),
    "fold": lambda: prove_fold(SUBCRITICAL, SUBCRITICAL_FOLD, digits=5),
}
Names = tuple[Any, ...]
ChangeOfContent = tuple[str, Callable[[Any], None]]


@lru_cache(maxsize=4)
def written(kind: str = "cycle") -> tuple[str, str]:
    """A certificate, and the statement that was proved."""
    proof = PROOFS[kind]()
    return proof.certificate(), proof.statement


def fresh(kind: str = "cycle") -> Any:
    return json.loads(written(kind)[0])


def at(content: Any, names: Names) -> Any:
    for name in names:
        content = content[name]
    return content


def flights(content: Any) -> list[Names]:
    """Where the logs are."""
    evidence, found = content["evidence"], []
    for prefix in [(name,) for name in evidence if "centre" in evidence[name]] or [()]:
        point = at(evidence, prefix)
        boxes = [name for name in ("box", "wide box") if name in point]
        found += [
            ("evidence", *prefix, "centre"),
            *(("evidence", *prefix, name, "flight") for name in boxes),
        ]
    return found


KNOWN: dict[Any, Any] = {}
FIELD_FOR_FRICTION, COEFFICIENTS = sliding.field_for_friction, System.coefficients


@pytest.fixture(scope="module")
def remembered() -> Iterator[None]:
    """Series that were computed once are not computed again: most of a tampered file is as it
    was.
    """

    def exactly(x: Any) -> Names:
        return (*x.mid().man_exp(), *x.rad().man_exp()) if x.is_finite() else (str(x),)

    def field(friction: str, constants: Any, omega: Any) -> Any:
        key = (
            "field",
            ctx.prec,
            friction,
            *(part for x in (*constants, omega) for part in exactly(x)),
        )
        if key not in KNOWN:
            KNOWN[key] = FIELD_FOR_FRICTION(friction, constants, omega)
        return KNOWN[key]

    def coefficients(self: System, start: Any, order: int) -> Any:
        key = (id(self), ctx.prec, order, *(part for x in start for part in exactly(x)))
        if key not in KNOWN:
            KNOWN[key] = COEFFICIENTS(self, start, order)
        return [list(column) for column in KNOWN[key]]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(krawczyk, "field_for_friction", field)
        patch.setattr(System, "coefficients", coefficients)
        yield
    KNOWN.clear()


# ----------------------------------------------------------------------------------------- accepted
def test_what_is_written_is_accepted_by_the_kernel_alone(remembered, tmp_path) -> None:
    """In a process of its own, with nothing of the search loaded; its sentence is the one
    that was proved.
    """
    path = tmp_path / "cycle.json"
    content, statement = written()
    path.write_text(content)
    script = (
        "import sys; from tippedisk_verify.proofs.kernel.__main__ import main; status = "
        "main(sys.argv[1:]); "
        "mine = {name for name in sys.modules if name.startswith('tippedisk_verify.')}; "
        "alone = ('tippedisk_verify.proofs.kernel', 'tippedisk_verify.errors'); "
        "print(sorted(name for name in mine if not name.startswith(alone) and name != "
        "'tippedisk_verify.proofs')); "
        "sys.exit(status)"
    )
    run = subprocess.run(
        [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stderr, run.stdout) == (0, "", f"proved: {statement}\n[]\n")


@pytest.mark.slow
def test_a_weaker_claim_is_another_true_claim(remembered) -> None:
    """With a new digest it is accepted as what it says: the statement has the wider number."""
    content = fresh()
    content["claim"]["numbers"]["period"]["uncertainty"] = "0.5"
    content["claim"]["stable"] = None
    sentence = verify_content(sealed(content))
    assert "± 0.5 s" in sentence
    assert "a periodic orbit, of undecided stability" in sentence


# ----------------------------------------------------------------------------------------- tampered
def times(number: str, power: int) -> str:
    mantissa, exponent = number.split("p")
    return f"{mantissa}p{int(exponent) + power}"


def further(number: str) -> str:
    with working_precision(2000):
        return dyadic_text(read_dyadic(number) + read_dyadic("1p-16"))


def _beyond(number: dict[str, str]) -> dict[str, str]:
    """Return the number three half-widths away."""
    value = Fraction(number["value"]) + 3 * Fraction(number["uncertainty"])
    return {**number, "value": exact_text(value)}


def false_claims(content: Any) -> list[ChangeOfContent]:
    """Every number elsewhere, and sharper than it is known; every parameter; the law; the
    speed; the rest.
    """
    claim = content["claim"]
    first = next(name for name in claim["numbers"] if name in ("gamma_bar_0", "beta_bar_top"))
    fold, number = "extremum" in claim, ("claim", "numbers")
    other = {"limit cycle": "rotating limit cycle", "rotating limit cycle": "limit cycle"}
    changes = [
        # Of a fold the arc, which is what the claim is about, is changed below
        *(
            change
            for name in claim["numbers"]
            if not fold or name != first
            for change in (
                (f"{name} elsewhere", replace_entry(*number, name, _beyond)),
                (
                    f"{name} too sharp",
                    replace_entry(
                        *number, name, "uncertainty", lambda w: exact_text(Fraction(w) / 10**9)
                    ),
                ),
                (
                    f"{name} of negative width",
                    replace_entry(*number, name, "uncertainty", lambda w: f"-{w}"),
                ),
            )
        ),
        *(
            (
                f"another {name}",
                replace_entry(
                    "claim", "parameters", name, lambda v: exact_text(Fraction(v) * 1001 / 1000)
                ),
            )
            for name in SYMBOLS
        ),
        ("a negative mass", replace_entry("claim", "parameters", "m", "-0.435")),
        (
            "another law",
            replace_entry(
                "claim", "friction", lambda law: "linear" if law == "smooth" else "smooth"
            ),
        ),
        (
            "another kind",
            replace_entry(
                "claim", "kind", other.get(claim["kind"], "fold of rotating limit cycles")
            ),
        ),
    ]
    if fold:
        return [
            *changes,
            (
                "another extremum",
                replace_entry(
                    "claim", "extremum", lambda e: "smallest" if e == "largest" else "largest"
                ),
            ),
            (
                "an arc beside",
                replace_entry(
                    *number, first, "value", lambda x: exact_text(Fraction(x) + Fraction(1, 10**4))
                ),
            ),
            ("an empty arc", replace_entry(*number, first, "uncertainty", "0")),
            (
                "a longer arc",
                replace_entry(
                    *number, first, "uncertainty", lambda x: exact_text(10 * Fraction(x))
                ),
            ),
        ]
    return [
        *changes,
        (
            "another speed",
            replace_entry("claim", "omega", lambda x: exact_text(Fraction(x) + Fraction(1, 10**6))),
        ),
        ("another stability", replace_entry("claim", "stable", lambda stable: not stable)),
        *(
            (f"alone too far in {name}", replace_entry("claim", "unique_within", name, "1"))
            for name in claim["unique_within"]
        ),
        *(
            [("reversals, which this law does not have", lambda c: c["claim"].update(reversals=4))]
            if claim["friction"] == "linear"
            else [
                ("other reversals", replace_entry("claim", "reversals", lambda n: n + 2)),
                ("no reversals", lambda c: c["claim"].pop("reversals")),
            ]
        ),
    ]


def other_evidence(content: Any) -> list[ChangeOfContent]:
    """Each flight's box, and its steps in the middle and at the end."""
    return [
        *(
            change
            for names in flights(content)
            for change in (*_other_box(names), *_other_flight(names, at(content, names)))
        ),
        ("24 bits", replace_entry("bits", 24)),
    ]


def _other_box(names: Names) -> list[ChangeOfContent]:
    above, inverse = names[:-1], (*names[:-1], "inverse")
    if names[-1] == "centre":
        return [
            (f"{names} elsewhere", replace_entry(*above, "middle", index, further))
            for index in (0, 1)
        ]
    return [
        *(
            (f"{names} without {index}", replace_entry(*above, "radii", index, "0p0"))
            for index in (0, 1)
        ),
        # Where 1 - Y F' becomes -3; an entry by itself may be as small as the fast contraction.
        (
            f"{names} inverse",
            replace_entry(*inverse, lambda y: [[times(x, 2) for x in row] for row in y]),
        ),
    ]


def _other_flight(names: Names, steps: list[Any]) -> list[ChangeOfContent]:
    entry = (*names, len(steps) // 2)
    first = (*entry, "steps", 0)
    changing = [index for index, step in enumerate(steps) if len(step["steps"]) > 1][:1]
    return [
        (f"{entry} much longer", replace_entry(*first, 0, lambda h: times(h, 3))),
        (f"{entry} backwards", replace_entry(*first, 0, lambda h: f"-{h}")),
        (f"{entry} of order 1", replace_entry(*first, lambda s: [s[0], 1, 1])),
        (f"{entry} flat axes", replace_entry(*entry, "axes", lambda a: [a[0], a[0], a[2]])),
        (f"{entry} untested", replace_entry(*entry, "steps", [])),
        *(
            change
            for index in changing
            for change in (
                (
                    f"{names} nothing behind a change",
                    replace_entry(*names, index, "steps", lambda s: s[:1]),
                ),
                (
                    f"{names} too short behind a change",
                    replace_entry(*names, index, "steps", 1, 0, lambda h: times(h, -6)),
                ),
            )
        ),
        (f"{names} last step missing", lambda c: at(c, names).pop()),
        # A single short step may be made up for by the last one, which need not end at the section.
        (
            f"{names} every third step missing",
            lambda c: at(c, names).__delitem__(slice(7, None, 3)),
        ),
        (f"{names} another step at the end", lambda c: at(c, names).append(at(c, names)[3])),
    ]


def unreadable(content: Any) -> list[ChangeOfContent]:
    """Return certificates with values that are no numbers here, and with other shapes."""
    step = (*flights(content)[0], 3)
    points = (
        1.5,
        1,
        None,
        [],
        "",
        "0x1p0",
        "1p",
        "1p1e3",
        "nan",
        " 1p0",
        "1p0 ",
        "+1p0",
        "\u0661p0",
    )
    decimals = (
        30.3,
        "nan",
        "inf",
        "1/0",
        "1/00",
        "1/",
        "3 0",
        "1_0",
        "0x1e",
        "",
        "\u0661",
        "1e99999",
    )
    return [
        *((f"{x!r} for a point", replace_entry(*step, "axes", 0, 0, x)) for x in points),
        *((f"{x!r} for a decimal", replace_entry("claim", "parameters", "g", x)) for x in decimals),
        *(
            (f"{x!r} bits", replace_entry("bits", x))
            for x in (0, 1, -1, 1.0, "64", True, 10**9, None, 23)
        ),
        ("unknown member", lambda c: c.update(comment="true")),
        ("unknown member of a step", replace_entry(*step, lambda s: s | {"note": "1p0"})),
        ("a step of two numbers", replace_entry(*step, "steps", 0, lambda s: s[:2])),
        ("a step of four numbers", replace_entry(*step, "steps", 0, lambda s: [*s, 1])),
        ("a fourth axis", replace_entry(*step, "axes", lambda a: [*a, a[0]])),
        ("missing member", lambda c: at(c, step).pop("axes")),
        ("no steps", lambda c: at(c, step[:-1]).clear()),
        ("unknown law", replace_entry("claim", "friction", "dry")),
        ("unknown kind", replace_entry("claim", "kind", "torus")),
        ("a length of 54 bits", replace_entry(*step, "steps", 0, 0, "20000000000001p-63")),
        ("a huge exponent", replace_entry(*step, "steps", 0, 0, "1p999999")),
    ]


def rejected(kind: str, name: str, act: Callable[[Any], None]) -> str:
    content = fresh(kind)
    act(content)
    assert content != fresh(kind), f"{name}: nothing was changed"
    with pytest.raises((certificates.Unproved, certificates.NotACertificate)) as fault:
        verify_content(sealed(content))
    line = str(fault.value)
    assert line.isprintable(), name
    # What can be read and was changed by hand is found by a line of the proof, not by the digest.
    assert "sha256" not in line.split("members")[0], name
    return line


@pytest.mark.parametrize(
    "kind",
    [
        "cycle",
        *(pytest.param(kind, marks=pytest.mark.slow(minutes=0.3)) for kind in ("rotation", "fold")),
    ],
)
def test_the_kernel_refuses_a_member_that_nothing_tests(
    kind: str, remembered, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever a shape allows: what the kernel has not looked at is not in a sentence that is
    proved.
    """
    content = fresh(kind)
    name = content["claim"]["kind"]
    shapes = certificates.KINDS[name].SHAPES
    claim, evidence = shapes[name]
    monkeypatch.setitem(shapes, name, (claim | {"note?": str}, evidence))
    content["claim"]["note"] = "and the disk is blue"
    with pytest.raises(certificates.Unproved, match="nothing tests note"):
        verify_content(sealed(content))


def mutations(kind: str) -> list[ChangeOfContent]:
    content = fresh(kind)
    return [*false_claims(content), *other_evidence(content), *unreadable(content)]


def test_unreadable_certificates_and_some_tampered_ones_are_rejected(remembered) -> None:
    content = fresh()
    changes = [*false_claims(content), *other_evidence(content)]
    for name, act in [*changes[3::7], *unreadable(content)]:
        rejected("cycle", name, act)
    assert len(changes) > 60


@pytest.mark.slow(minutes=1)
@pytest.mark.parametrize("kind", PROOFS)
def test_certificates_of_every_kind_are_accepted_and_all_tampered_ones_rejected(
    kind: str, remembered
) -> None:
    content, statement = written(kind)
    assert verify_content(json.loads(content)) == statement
    lines = {name: rejected(kind, name, act) for name, act in mutations(kind)}
    for said in (
        "stay in its enclosure",
        "its steps end before the flight does",
        "it has unused steps",
        "Krawczyk's image",
        "within its uncertainty",
        "no disk has",
        "as text",
        "whole number",
        "exactly the members",
    ):
        assert any(said in line for line in lines.values()), said


def test_a_half_width_of_a_few_last_bits_is_held() -> None:
    """As that of the sharpest of a cycle's numbers to many digits; and half of it is not."""
    with working_precision(64):
        for n in range(3, 200, 2):
            x = arb(1) / n
            middle, half = midpoint_and_radius(x)
            require_claimed_enclosure(
                {"value": str(middle), "uncertainty": str(half)}, x, "a number"
            )
            with pytest.raises(certificates.Unproved):
                require_claimed_enclosure(
                    {"value": str(middle), "uncertainty": str(half / 2)}, x, "a number"
                )


# ---------------------------------------------------------------------------------- as a user meets
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfe\x00",
        b'{"a":' * 50_000,
        b"nan",
        b"1",
        b"{}",
        b'{"format": "tippedisk certificate 3", "claim": 1}',
        b'{"format": "tippedisk certificate 3", "claim": {"kind": ["limit cycle"]}}',
        b'{"format": "tippedisk certificate 2", "claim": {"kind": "limit cycle"}}',
        b'{"format": 1, "format": "tippedisk certificate 3"}',
        b'{"bits": ' + b"9" * 5000 + b"}",
        b'{"format": "tippedisk certificate 3", "claim": {"kind": "limit cycle"}, "bits": 1e400}',
    ],
)
def test_what_is_no_certificate_ends_in_one_line(tmp_path, content) -> None:
    path = tmp_path / "file.json"
    path.write_bytes(content)
    assert_refused(["certify", "check", str(path)])


def test_a_claim_that_is_not_shown_has_status_one_and_its_line(tmp_path) -> None:
    content = fresh()
    content["evidence"]["centre"][0]["steps"][0][0] = "-1p-10"
    path = tmp_path / "file.json"
    path.write_text(json.dumps(sealed(content)))
    line = "box, centre, step 1: the states and derivatives over it are not shown to stay in its enclosure"
    command = ["certify", "check", str(path)]
    assert ran(command) == (1, "", f"tippedisk-verify: not proved: {line}\n")
    assert answer(f"certify check {path}", status=1) == {"accepted": False, "fails": line}
    path.write_text(json.dumps(fresh() | {"bits": 65}))
    assert "its digest, sha256" in ran(command).err


def test_without_a_proof_no_certificate_is_written(tmp_path) -> None:
    target = tmp_path / "c.json"
    nowhere = "certify orbit --omega 30.4 --guess 1e-9 1e-9 --digits 2 --quiet"
    printed(f"{nowhere} --certificate {target}", status=1)
    assert not target.exists()
