"""Nonsense on the command line and from Python: refused at once, in one line, with nothing written."""

from __future__ import annotations

import resource
from pathlib import Path

import click
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

import tippedisk_verify as tv
from tests.stress.nonsense import (
    SHAPES,
    WORDS,
    Shape,
    assert_refused,
    contents,
    furnished,
    ran,
)
from tippedisk_verify.cli import cli


# ------------------------------------------------------------------------------------------ the command line
def _leaves(command: click.Command, words: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], click.Command]]:
    if isinstance(command, click.Group):
        return [leaf for name, inner in command.commands.items() for leaf in _leaves(inner, (*words, name))]
    return [(words, command)]


def test_every_command_and_every_option_is_spoiled_somewhere() -> None:
    spoiled: dict[tuple[str, ...], set[str]] = {}
    for shape in SHAPES.values():
        names = tuple(word for word in shape.words if not word.startswith("--"))
        spoiled.setdefault(names, set()).update(shape.options)
    # --below-crit is of the same kind as --omega (test_speeds_below_omega_crit); the others take two values.
    elsewhere = {"--below-crit", "--guess", "--range"}
    for words, command in _leaves(cli):
        options = [option for option in command.params if isinstance(option, click.Option) and not option.is_flag]
        taken = {name for option in options for name in option.opts if name.startswith("--")}
        assert taken - elsewhere <= spoiled[words], words


@st.composite
def spoiled(draw: st.DrawFn) -> list[str]:
    """A command that is right but for one option or argument."""
    spoilable = sorted(name for name, shape in SHAPES.items() if shape.options or shape.arguments)
    shape: Shape = SHAPES[draw(st.sampled_from(spoilable))]
    names = [*shape.options, *range(len(shape.arguments))]
    bad = draw(st.sampled_from(names))
    words = list(shape.words)
    for position, (right, wrong) in enumerate(shape.arguments):
        words.append(draw(wrong) if position == bad else right)
    for name, (right, wrong) in shape.options.items():
        words += [name, draw(wrong) if name == bad else right]
    return words


class _Draws:
    """How many there were, and the most that a refusal cost [s of CPU]."""

    count, longest, command = 0, 0.0, ""


def _hold(arguments: list[str]) -> None:
    done = assert_refused(arguments)
    _Draws.count += 1
    if done.seconds > _Draws.longest:
        _Draws.longest, _Draws.command = done.seconds, " ".join(arguments)[:120]


@pytest.fixture
def room(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = furnished(tmp_path_factory.mktemp("room"))
    monkeypatch.chdir(folder)
    return folder


# A draw that is not refused may run for long: it is told as it is, not made shorter.
_PHASES = (Phase.explicit, Phase.reuse, Phase.generate)
_WITH_ROOM = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]


@settings(max_examples=150, phases=_PHASES, suppress_health_check=_WITH_ROOM, deadline=None)
@given(spoiled())
def test_one_mistake_is_refused_and_nothing_is_written(room: Path, arguments: list[str]) -> None:
    before = contents(room)
    _hold(arguments)
    # The folder of --out is made before the rest is looked at; it stays empty, or holds a lock.
    after = {name: what for name, what in contents(room).items() if not name.startswith("out")}
    assert after == {name: what for name, what in before.items() if not name.startswith("out")}


@pytest.mark.slow
def test_five_thousand_mistakes(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The counts and the dearest refusal are printed."""

    @seed(20)
    @settings(max_examples=5_000, phases=_PHASES, suppress_health_check=list(HealthCheck), deadline=None, database=None)
    @given(spoiled())
    def hold(arguments: list[str]) -> None:
        _hold(arguments)

    _Draws.count, _Draws.longest = 0, 0.0
    before, memory = contents(room), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    hold()
    after = contents(room)
    assert {name: after[name] for name in before} == before
    assert {name.split("/")[0] for name in after} - set(before) <= {"out"}
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
    with capsys.disabled():
        print(
            f"\n{_Draws.count} draws, dearest {_Draws.longest:.2f} s ({_Draws.command!r}), {grown} kB more at the peak"
        )


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.one_of(WORDS, st.sampled_from(["--json", "--omega", "sweep", "verify", "--", "-h", "--version"])), max_size=6
    )
)
def test_words_in_any_order_give_a_status_and_at_most_one_line(words: list[str]) -> None:
    if words and words[0] == "verify" and not set(words) - {"verify", "--json", "--"}:
        return  # that is the whole audit
    done = ran(words)
    assert done.status in (0, 2)
    assert done.err.count("\n") == (1 if done.status else 0)


@pytest.mark.parametrize("command", ["equilibria", "orbit", "harmonic-balance", "basin"])
@pytest.mark.parametrize("distance", ["nan", "", "31", "1e400", "pi", "-1e6", "1" * 5000, "-1e9999", "x"])
def test_speeds_below_omega_crit(command: str, distance: str) -> None:
    assert_refused([command, "--below-crit", distance])


@pytest.mark.parametrize(
    "arguments",
    [
        ["hopf", "--digits", "1000000000"],
        ["hopf", "--digits", "4001"],
        ["heteroclinic", "--digits", "1001"],
        ["orbit", "--above-het", "1e-30", "--digits", "1000"],
        ["orbit", "--above-het", "1e-801"],
        ["harmonic-balance", "--omega", "30.4", "--harmonics", "1025"],
        ["slow-manifold", "--order", "41"],
        ["basin", "--omega", "30.4", "--count", "10000001"],
        ["scene", "d", "--digits", "13"],
        ["sweep", "hopf", "--over", "mu=0:1:1001", "--over", "g=9:10:1000", "--out", "o.csv"],
        ["sweep", "hopf", "--over", "mu=0.3", "--out", "o.csv", "--jobs", "1000000"],
        ["equilibria", "--omega", "30.4", "--omega", "31", "--below-crit", "0.5"],
        ["verify", "--only", ","],
        ["branch", "--omegas", "30.4,1e300"],
        ["branch", "--omegas", "30.4,31.5"],
        ["branch", "--omegas", "30.4,29"],
        ["orbit", "--omega", "1e-300"],
        ["harmonic-balance", "--omega", "4"],
        ["orbit", "--omega", "29"],
    ],
    ids=lambda arguments: " ".join(arguments)[:60],
)
def test_what_has_a_bound_says_so(arguments: list[str], room: Path) -> None:
    before = contents(room)
    assert_refused(arguments)
    assert contents(room) == before


def test_the_most_digits_are_had() -> None:
    """What is asked for is the bound, not what is computed beyond it; integers of over 4300 digits are printed."""
    for arguments in (["hopf"], ["equilibria", "--omega", "30.4"], ["equilibria", "--below-crit", "0.5"]):
        done = ran([*arguments, "--digits", "4000", "--json"])
        assert (done.status, done.err) == (0, "")
    value, width = tv.Measured.of(10**4400, 0).decimals()
    assert (value, width) == ("1" + "0" * 4400, "0")


_SIZES = st.sampled_from(["1e-29", "1e-20", "1e-10", "1e-3", "0.3", "1", "1e3", "1e10", "1e20", "9e29"])


@settings(max_examples=60, deadline=None)
@given(
    st.fixed_dictionaries(dict.fromkeys(("r", "e", "m", "A", "B", "g", "mu", "epsilon"), _SIZES)),
    st.sampled_from(["hopf", "equilibria"]),
)
def test_disks_beyond_any_workshop(
    tmp_path_factory: pytest.TempPathFactory, values: dict[str, str], command: str
) -> None:
    """Of the extremes that pass for a disk, an answer, a shortfall or a refusal: one line, and no traceback."""
    path = tmp_path_factory.mktemp("disk") / "disk.toml"
    path.write_text("".join(f'{name} = "{value}"\n' for name, value in values.items()))
    done = ran(
        [command, *(["--omega", "30.4"] if command == "equilibria" else []), "--parameters", str(path), "--json"]
    )
    assert done.status in (0, 1, 2)
    assert done.err.count("\n") == (1 if done.status else 0)
