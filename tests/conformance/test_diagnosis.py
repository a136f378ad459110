"""The engine behind the diagnosis: right ways of writing the program, changes of it, and what is found again."""

from __future__ import annotations

import ast

import numpy as np
import pytest

from tippedisk_verify.conformance.diagnosis.cycles import cycle_causes
from tippedisk_verify.conformance.diagnosis.entries import Sheet, Table, tables_of
from tippedisk_verify.conformance.diagnosis.operators import changes
from tippedisk_verify.conformance.diagnosis.search import Search
from tippedisk_verify.conformance.diagnosis.specimen import Program, Specimen, specimen
from tippedisk_verify.conformance.diagnosis.statement import diagnosed
from tippedisk_verify.conformance.diagnosis.trees import places, statements, values
from tippedisk_verify.conformance.diagnosis.ways import ways
from tippedisk_verify.conformance.grading import graded
from tippedisk_verify.conformance.sheet import Answers
from tippedisk_verify.reference_values.store import Store, stored

_LEVELS = range(1, 6)


@pytest.fixture(scope="module")
def store() -> Store:
    return stored()


@pytest.fixture(scope="module")
def tables(store: Store) -> list[Table]:
    """The printed set's questions up to level 5, answered by the truths."""
    given = {q.id: ("doubles", repr(q.for_doubles)) for q in store.matching("printed/") if q.level in _LEVELS}
    return tables_of(graded(Answers(given), store), store)


@pytest.mark.parametrize("way", ways(), ids=lambda way: way.way or "the client")
def test_each_way_is_right(way: Specimen, tables: list[Table]) -> None:
    for table in tables:
        sheet = Sheet((table,))
        assert np.all(np.abs(Program(way).answers(sheet) - sheet.truth) <= sheet.allowed)


def test_a_changed_program_whose_loops_do_not_end_is_stopped(tables: list[Table]) -> None:
    table = next(table for table in tables if table.kind == "slow-manifold")
    function = ast.parse(specimen().text("series_product").replace("range(size)", "range(size**9)")).body[0]
    assert Program(specimen(), {"series_product": function}).results(table) == {}


def test_changes_differ_from_what_stands_there_and_leave_it_as_it_is() -> None:
    function = specimen().functions["equations"]
    before = ast.dump(function)
    for statement, path in statements(function):
        for place, _ in values(function, statement, path):
            for spot in (place, *places(function, place.node, place.path)):
                for change in changes(spot, ["r", "e", "rho", "A", "Bbar"]):
                    assert ast.dump(change.node) != ast.dump(spot.node)
                    compile(ast.unparse(spot.replaced(change.node)), "changed", "exec")
    assert ast.dump(function) == before


#: function, what stands there, what is planted, and what the diagnosis has to say.
_PLANTED = (
    ("equations", "w_y * lambda_Ty", "lambda_Ty", "the factor w_y is missing in w_y lambda_Ty"),
    ("derivatives", "e * cos(gamma)", "r * cos(gamma)", "r cos(gamma) for e cos(gamma)"),
    ("linearisation", "- Omega ** 2", "+ Omega ** 2", "in A_31 (linearisation): +Omega^2 for -Omega^2"),
    ("hopf", "2 * pi / omega", "pi / omega", "period has the factor 1/2"),
    ("one_harmonic_law", "chi * Omega ** 2", "chi * Omega", "Omega for Omega^2"),
)


@pytest.mark.parametrize(("name", "old", "new", "says"), _PLANTED, ids=[case[0] for case in _PLANTED])
def test_a_planted_change_is_found_again(
    name: str, old: str, new: str, says: str, tables: list[Table], store: Store
) -> None:
    text = specimen().text(name)
    assert old in text
    program = Program(specimen(), {name: ast.parse(text.replace(old, new, 1)).body[0]})
    given: dict[str, tuple[str, str]] = {}
    for table in tables:
        found = table.picked(program.results(table))
        for cell, value in enumerate(found):
            entry = table.entries[table.rows[cell]]
            given[f"{entry.id}/{table.names[cell]}"] = ("doubles", repr(float(value)))
    (first, *_) = diagnosed(graded(Answers(given), store), store)
    assert says in first.says()
    cause = first.to_dict()["causes"][0]
    if cause["function"]:  # not what a relation of outputs says as simply
        assert cause["function"] == name
        assert cause["before"] in text
        assert cause["after"] not in text


@pytest.mark.parametrize(
    ("over", "step"),
    [("2 * h", "2e-5 (forward, or twice a central one's)"), ("points[0][place] - points[1][place]", "1e-5 (central)")],
    ids=["written", "rounded"],
)
def test_digits_of_differences_hide_no_other_mistake(over: str, step: str, tables: list[Table], store: Store) -> None:
    """Derivatives by central differences, over the step as written or as rounded, and a sign in h: both are said."""
    change = specimen().text("equations").replace("-2 * (A - Bbar)", "2 * (A - Bbar)")
    differences = specimen().patched("differences", _DIFFERENCES.replace("OVER", over))
    program = Program(differences, {"equations": ast.parse(change).body[0]})
    given = {q.id: ("doubles", repr(q.for_doubles)) for q in store.matching("printed/") if q.level in _LEVELS}
    for table in tables:
        if table.level == 1:
            found = table.picked(program.results(table))
            given |= {id_: ("doubles", repr(float(x))) for id_, x in zip(table.ids, found, strict=True)}
    one, two = diagnosed(graded(Answers(given), store), store)
    assert f"difference quotient with a step of {step}" in one.says()
    assert "in term h_2 of h: the minus sign of -2 is missing" in two.says()


_DIFFERENCES = """
def derivatives(p, Omega, smooth, beta, gamma, v):
    h, rates = 1e-5, []
    for place in (1, 2, 3, 0):
        points = [[x + sign * h * (n == place) for n, x in enumerate((Omega, beta, gamma, v))] for sign in (1, -1)]
        ends = [equations(p, point[0], smooth, *point[1:])[7] for point in points]
        rates.append((ends[0] - ends[1]) / (OVER))
    return (*rates, equations(p, Omega, smooth, beta, gamma, v)[7])
"""


def test_cycles_on_the_equilibrium_are_said_to_be_that(store: Store) -> None:
    given = {q.id: ("doubles", repr(q.for_doubles)) for q in store.matching("printed/linear/limit-cycle/")}
    for id_ in given:
        if any(f"/crit-{shift}/" in id_ for shift in ("0.05", "0.1", "0.3")):
            given[id_] = "doubles", "1e-12" if id_.endswith(("/gamma_bar_0", "/v_0", "/beta_max")) else "1.01"
    (found,) = diagnosed(graded(Answers(given), store), store)
    assert "are the equilibrium: a shooting that fell onto it" in found.says()


@pytest.mark.parametrize("kind", ["limit-cycle", "rotating-cycle"])
def test_what_is_made_of_a_cycle_is_a_change_of_the_client(kind: str, store: Store) -> None:
    """Right cycles with the square root of their slow multiplier."""
    given = {}
    for quantity in store.matching(f"printed/linear/{kind}/"):
        value = quantity.for_doubles
        given[quantity.id] = "doubles", repr(value**0.5 if quantity.name == "multiplier_slow" else value)
    causes = cycle_causes(Search(Sheet(tuple(tables_of(graded(Answers(given), store), store)))))
    assert "sqrt(multiplier_slow) for multiplier_slow" in [cause.says.partition(": ")[2] for cause in causes]


def test_samples_of_another_time_are_named(store: Store) -> None:
    """Along an orbit that is answered at every sample, a sample is the next one's answer."""
    entry = "printed/linear/trajectory/d1/"
    asked = [quantity for quantity in store.matching(entry) if "@" in quantity.name]
    following = dict(zip(asked, asked[3:], strict=False))  # beta, gamma and v of a time follow each other
    names = {one: other for one, other in following.items() if one.name.split("@")[0] == other.name.split("@")[0]}
    given = {one.id: ("doubles", repr(names.get(one, one).for_doubles)) for one in asked if one in names}
    (found,) = diagnosed(graded(Answers(given), store), store)
    assert found.level == 6
    assert "next" in found.says()
    given = {id_: (reading, f"{float(text) + len(id_) % 7:.6f}") for id_, (reading, text) in given.items()}
    (none,) = diagnosed(graded(Answers(given), store), store)
    assert none.says().endswith("; formulas are tried at levels 1 to 5 only: answer v_rate of level 1 too")
