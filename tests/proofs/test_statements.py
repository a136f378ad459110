"""A statement stands by itself: which tippedisk, which friction law, which speed, exactly; and its numbers."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path

import pytest

from tippedisk_verify.cli import main
from tippedisk_verify.connection.heteroclinic import heteroclinic
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Parameters
from tippedisk_verify.proofs.search.heteroclinic import prove_connection
from tippedisk_verify.reference_values.lookup import references
from tippedisk_verify.reference_values.store import data_folder

SYMBOLS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
#: mu is no decimal, and g another one than usual.
DISK = PRINTED.changed(mu="1/7", epsilon="1/21", g="9.8100001")
#: References to what is printed elsewhere.
OUTSIDE = re.compile(r"\bgiven\b|\bprinted beside\b|\blisted\b|\babove\b(?! Omega_crit)")


def numbers_of(statement: str) -> dict[str, Fraction]:
    """The eight numbers as the statement gives them."""
    found = {name: re.search(rf"(?<!\w){name} = (-?[\d.]+(?:e-?\d+)?(?:/\d+)?)", statement) for name in SYMBOLS}
    return {name: Fraction(match[1]) for name, match in found.items() if match}


def is_about(statement: str, disk: Parameters) -> bool:
    return numbers_of(statement) == {name: getattr(disk, name) for name in SYMBOLS} and not OUTSIDE.search(statement)


@pytest.fixture
def disk_file(tmp_path: Path) -> str:
    path = tmp_path / "disk.toml"
    lines = [f'{name} = "{getattr(DISK, name)}"' for name in SYMBOLS]
    path.write_text("\n".join(lines))
    return str(path)


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert main(["certify", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_equilibria(capsys: pytest.CaptureFixture[str], disk_file: str) -> None:
    found = said(capsys, "equilibria", "--parameters", disk_file, "--omega", "91/3")
    for name, gamma in (("inverted", "pi/2"), ("noninverted", "-pi/2")):
        statement = found[name]["statement"]
        assert is_about(statement, DISK)
        assert "Omega = 91/3 rad/s" in statement
        assert "linear as under the smooth" in statement
        assert f"{name} spinning, (beta, gamma, v) = (pi/2, {gamma}, 0)" in statement
        for value in found[name]["eigenvalues"]:
            assert f"{value['re']['value']} ± {value['re']['uncertainty']}" in statement


def test_hopf(capsys: pytest.CaptureFixture[str], disk_file: str) -> None:
    found = said(capsys, "hopf", "--parameters", disk_file)
    assert is_about(found["statement"], DISK)
    assert "linear friction law" in found["statement"]
    intervals = [value for value in found.values() if isinstance(value, dict)]
    assert len(intervals) == 8
    for value in intervals:
        assert f"{value['value']} ± {value['uncertainty']}" in found["statement"]


def test_orbit(capsys: pytest.CaptureFixture[str]) -> None:
    """The speed is a third of a decimal: no decimal of it would be the speed that is proved."""
    speed = Fraction("30.3") + Fraction(1, 15)
    found = said(capsys, "orbit", "--omega", f"{speed}", "--digits", "5", "--guess", "1.7457", "-1.713")
    statement = found["statement"]
    assert found["proved"] is True
    assert is_about(statement, PRINTED)
    assert "linear friction law" in statement
    assert f"Omega = {speed} rad/s" in statement
    for name in ("gamma_bar_0", "v_0", "period", "beta_max", "multiplier_slow", "log_multiplier_fast"):
        assert f"{found[name]['value']} ± {found[name]['uncertainty']}" in statement
    for distance in found["unique_within"].values():
        assert f"within {distance} rad" in statement


@pytest.fixture(scope="module")
def connection_statement() -> tuple[str, dict]:
    proof = prove_connection(CALIBRATED, "30.06722434057692584525", 8)
    return proof.statement, proof.to_dict()


def test_connection(connection_statement: tuple[str, dict]) -> None:
    statement, found = connection_statement
    assert is_about(statement, CALIBRATED)
    assert "linear friction law" in statement
    assert f"|Omega - {found['omega_h']['value']} rad/s| <= {found['omega_h']['uncertainty']} rad/s" in statement
    room = found["room"]
    assert f"|beta - pi/2| <= {room['beta']}, |gamma - 3 pi/2| <= {room['gamma']}, |v| <= {room['v']}" in statement
    assert f"first has gamma = 3 pi/2 - {room['gamma']}," in statement
    for value in found["saddle_eigenvalues"]:
        assert f"{value['value']} ± {value['uncertainty']}" in statement


def test_the_connection_of_the_ordinary_road_stays_where_the_statement_says(
    connection_statement: tuple[str, dict], taylor: Taylor
) -> None:
    """In double it is followed to 1e-4 or so of the saddle, a hundredth of the box."""
    _, found = connection_statement
    beta_room, gamma_room, v_room = (float(found["room"][name]) for name in ("beta", "gamma", "v"))
    quarter = 1.5707963267948966
    _, (beta, gamma, v) = heteroclinic(CALIBRATED, taylor).orbit(20_001)
    inside = (abs(beta - quarter) <= beta_room) & (abs(gamma - 3 * quarter) <= gamma_room) & (abs(v) <= v_room)
    arrived = gamma >= 3 * quarter - gamma_room
    assert 10 < arrived.sum() < 20_000
    assert not arrived[: arrived.argmax()].any()
    assert inside[arrived].all()


def test_every_stored_statement_is_about_its_own_entry() -> None:
    proofs = json.loads((data_folder() / "proofs.json").read_text(encoding="utf-8"))
    for id_, proof in proofs.items():
        statement, inputs = proof["statement"], references(f"{id_}/")[0].inputs
        assert is_about(statement, Parameters.named(id_.partition("/")[0])), id_
        assert "friction law" in statement, id_
        if "Omega" in inputs:
            assert f"Omega = {inputs['Omega']} rad/s" in statement, id_
    assert len(proofs) >= 60
